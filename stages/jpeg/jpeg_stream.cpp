#include "stages/jpeg/jpeg_stream.h"

#include <string>

#include "format/base/errors.h"

namespace texmesh {
namespace {

using Span = std::span<const std::uint8_t>;

constexpr std::uint8_t kSos = 0xda, kEoi = 0xd9;
constexpr std::uint8_t kEndOfBlock = 0x00, kSixteenZeros = 0xf0;

[[noreturn]] void fail_scan(const char* expected, std::string found) {
  throw FormatError("JPEG", "entropy-coded data", expected, std::move(found));
}

/// Bits of entropy-coded data, with the zero bytes behind 0xFF taken out.
class BitReader {
 public:
  explicit BitReader(Span data) : data_(data) {}
  unsigned bit() {
    if (count_ == 0) next_byte();
    return byte_ >> --count_ & 1u;
  }
  void skip(unsigned bits) {
    while (bits > count_) {
      bits -= count_;
      count_ = 0;
      next_byte();
    }
    count_ -= bits;
  }

 private:
  void next_byte() {
    if (at_ == data_.size()) fail_scan("more blocks", "the end");
    byte_ = data_[at_++];
    count_ = 8;
    if (byte_ == 0xff && (at_ == data_.size() || data_[at_++] != 0)) fail_scan("coded bits", "a marker");
  }
  Span data_;
  std::size_t at_ = 0;
  unsigned byte_ = 0, count_ = 0;
};

/// A table in the form of ISO 10918-1 F.2.2.3: codes of one length are consecutive numbers.
struct HuffmanDecoder {
  explicit HuffmanDecoder(const HuffmanTable& table) : symbols(table.symbols) {
    int code = 0, index = 0;
    for (std::size_t l = 1; l <= 16; ++l) {
      first_index[l] = index - code;
      code += table.bits[l];
      index += table.bits[l];
      end_code[l] = code;
      code <<= 1;
    }
  }
  std::uint8_t next(BitReader& in) const {
    int code = 0;
    for (std::size_t l = 1; l <= 16; ++l) {
      code = code << 1 | static_cast<int>(in.bit());
      if (code < end_code[l]) return symbols[static_cast<std::size_t>(first_index[l] + code)];
    }
    fail_scan("a code of the table", "another");
  }
  const std::vector<std::uint8_t>& symbols;
  std::array<int, 17> first_index{}, end_code{};
};

void count_block(BitReader& in, const HuffmanDecoder& dc, const HuffmanDecoder& ac,
                 std::array<std::uint64_t, 256>& dc_count, std::array<std::uint64_t, 256>& ac_count) {
  const std::uint8_t category = dc.next(in);
  ++dc_count[category];
  in.skip(category);
  for (std::size_t k = 1; k < kBlockCoefficients;) {
    const std::uint8_t symbol = ac.next(in);
    ++ac_count[symbol];
    if (symbol == kEndOfBlock) return;
    in.skip(symbol & 15u);
    k += symbol == kSixteenZeros ? 16u : (symbol >> 4) + 1u;
  }
}

}  // namespace

void count_symbols(Span data, Span mcu, std::size_t blocks, const HuffmanTables& tables,
                   SymbolCounts& counts) {
  const std::vector<HuffmanDecoder> decoders(tables.begin(), tables.end());
  counts.resize(tables.size());
  BitReader in(data);
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::size_t dc = 2u * mcu[b % mcu.size()], ac = dc + 1;
    count_block(in, decoders.at(dc), decoders.at(ac), counts[dc], counts[ac]);
  }
}

std::vector<std::size_t> scan_ends(Span body) {
  std::vector<std::size_t> ends;
  std::size_t at = 0;
  const auto require = [&](bool good) {
    if (!good) throw FormatError("JPEG", "byte " + std::to_string(at), "segments and scans", "other bytes");
  };
  while (at < body.size()) {
    require(at + 2 <= body.size() && body[at] == 0xff);
    const std::uint8_t marker = body[at + 1];
    if (marker == kEoi) break;
    require(at + 4 <= body.size());
    at += 2u + (std::size_t{body[at + 2]} << 8 | body[at + 3]);
    require(at <= body.size());
    if (marker != kSos) continue;
    // Entropy-coded data end where 0xFF is followed by anything but a stuffed zero.
    while (at < body.size() && !(body[at] == 0xff && at + 1 < body.size() && body[at + 1] != 0)) ++at;
    ends.push_back(at);
  }
  return ends;
}

}  // namespace texmesh
