#include "stages/jpeg/jpeg_stream.h"

#include <algorithm>

#include "format/base/errors.h"

namespace texmesh {

HuffmanTable make_huffman_table(const std::vector<std::uint8_t>& symbols,
                                const std::vector<std::uint64_t>& weights) {
  // The reserved symbol 256 of weight 1 takes the code of ones only and is dropped afterwards.
  constexpr int kReserved = 256;
  struct Node {
    std::uint64_t weight;
    int symbol;               // the highest one beneath, for ties
    std::vector<int> leaves;  // symbols beneath
  };
  std::vector<Node> nodes{{1, kReserved, {kReserved}}};
  for (std::size_t k = 0; k < symbols.size(); ++k) nodes.push_back({weights[k], symbols[k], {symbols[k]}});
  std::array<int, 257> length{};
  const auto lighter = [](const Node& a, const Node& b) {
    return a.weight != b.weight ? a.weight > b.weight : a.symbol < b.symbol;
  };
  std::make_heap(nodes.begin(), nodes.end(), lighter);
  while (nodes.size() > 1) {
    std::pop_heap(nodes.begin(), nodes.end(), lighter);
    Node a = std::move(nodes.back());
    nodes.pop_back();
    std::pop_heap(nodes.begin(), nodes.end(), lighter);
    Node& b = nodes.back();
    b.weight += a.weight;
    b.symbol = std::max(a.symbol, b.symbol);
    b.leaves.insert(b.leaves.end(), a.leaves.begin(), a.leaves.end());
    for (int leaf : b.leaves) ++length[static_cast<std::size_t>(leaf)];
    std::push_heap(nodes.begin(), nodes.end(), lighter);
  }
  // Codes longer than 16 bits move up: of a pair of the longest, one takes the parent's place and the other
  // shares the place of a shorter code (annex K.2, figure K.3).
  std::vector<std::size_t> count(symbols.size() + 2);
  for (int l : length) ++count[static_cast<std::size_t>(l)];
  count[0] = 0;  // numbers that are no symbol
  for (std::size_t l = count.size() - 1; l > 16; --l)
    while (count[l] > 0) {
      std::size_t shorter = l - 2;
      while (count[shorter] == 0) --shorter;
      count[l] -= 2;
      ++count[l - 1];
      count[shorter + 1] += 2;
      --count[shorter];
    }
  std::size_t longest = std::min<std::size_t>(16, count.size() - 1);
  while (count[longest] == 0) --longest;
  --count[longest];  // the reserved one
  HuffmanTable out;
  for (std::size_t l = 1; l <= longest; ++l) out.bits[l] = static_cast<std::uint8_t>(count[l]);
  out.symbols = symbols;
  std::sort(out.symbols.begin(), out.symbols.end(), [&](std::uint8_t a, std::uint8_t b) {
    return length[a] != length[b] ? length[a] < length[b] : a < b;
  });
  return out;
}

SymbolCodes symbol_codes(const HuffmanTable& table) {
  SymbolCodes out;
  unsigned code = 0;
  std::size_t index = 0;
  for (std::size_t l = 1; l <= 16; ++l, code <<= 1)
    for (unsigned n = table.bits[l]; n > 0; --n, ++code, ++index) {
      out.code[table.symbols[index]] = static_cast<std::uint16_t>(code);
      out.bits[table.symbols[index]] = static_cast<std::uint8_t>(l);
    }
  return out;
}

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
