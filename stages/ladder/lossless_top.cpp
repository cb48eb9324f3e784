#include "stages/ladder/lossless_top.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <utility>

#include "format/base/bytes.h"
#include "format/documents/textures.h"
#include "stages/base/parallel.h"
#include "stages/image/decode_image.h"
#include "stages/image/decode_jpeg.h"
#include "stages/jpeg/bit_writer.h"
#include "stages/jpeg/huffman_table.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {
namespace {

using Component = JpegCoefficients::Component;

constexpr unsigned kMostDcBits = 11, kMostAcBits = 10;  // of baseline JPEG (ISO/IEC 10918-1, F.1.2)

/// The components as the fragments' files have them. Equal factors everywhere mean no subsampling, however
/// large, and a file of several components could not interleave so many blocks.
std::vector<Component> plain_components(const JpegCoefficients& source) {
  std::vector<Component> out = source.components();
  const auto all = [&](std::uint32_t Component::*factor) {
    return std::ranges::all_of(out, [&](const Component& c) { return c.*factor == out[0].*factor; });
  };
  for (const auto factor : {&Component::across, &Component::down})
    if (all(factor))
      for (Component& c : out) c.*factor = 1;
  return out;
}

/// A number as entropy-coded data have it.
struct Coded {
  unsigned bits;       // of the magnitude
  std::uint32_t tail;  // those bits, of a negative number less one
};

Coded coded(int value) {
  const unsigned bits = static_cast<unsigned>(std::bit_width(static_cast<unsigned>(std::abs(value))));
  const auto tail = static_cast<std::uint32_t>(value < 0 ? value - 1 : value) & ((1u << bits) - 1);
  return {bits, tail};
}

/// The symbols of fragments in the order of a baseline scan.
class FragmentScan {
 public:
  FragmentScan(const JpegCoefficients& source, const TexturePlane& plane)
      : source_(source), plane_(plane), components_(plain_components(source)) {
    for (const Component& c : components_) {
      most_across_ = std::max(most_across_, c.across);
      most_down_ = std::max(most_down_, c.down);
    }
  }
  const std::vector<Component>& components() const { return components_; }

  /// Calls put(table, symbol, tail, tail bits) for every symbol, with the bits that follow it; table is 2 t
  /// for DC and 2 t + 1 for AC.
  template <class Put>
  void for_each_symbol(std::size_t fragment, const Put& put) const {
    const TexelRectangle at = padded_fragment_rectangle(plane_, fragment);
    const std::uint32_t mcu_width = 8 * most_across_, mcu_height = 8 * most_down_;
    std::array<int, 3> dc{};
    for (std::uint32_t y = at.top_px / mcu_height; y < at.bottom_px() / mcu_height; ++y)
      for (std::uint32_t x = at.left_px / mcu_width; x < at.right_px() / mcu_width; ++x)
        for (std::size_t c = 0; c < components_.size(); ++c)
          for (std::uint32_t v = 0; v < components_[c].down; ++v)
            for (std::uint32_t u = 0; u < components_[c].across; ++u)
              put_block(c, y * components_[c].down + v, x * components_[c].across + u, dc[c], put);
  }

 private:
  template <class Put>
  void put_block(std::size_t component, std::uint32_t row, std::uint32_t column, int& dc,
                 const Put& put) const {
    const std::size_t table = component == 0 ? 0 : 2;
    const Component& c = components_[component];
    if (row >= c.blocks_down || column >= c.blocks_across) {  // nothing of the image: as the block before
      put(table, 0u, 0u, 0u);
      put(table + 1, 0u, 0u, 0u);
      return;
    }
    const std::int16_t* block = source_.block(component, row, column);
    const Coded step = coded(block[0] - dc);
    dc = block[0];
    put(table, step.bits, step.tail, step.bits);
    unsigned zeros = 0;
    for (std::size_t k = 1; k < 64; ++k) {
      const int value = block[kNaturalOfZigzag[k]];
      if (value == 0) {
        ++zeros;
        continue;
      }
      for (; zeros > 15; zeros -= 16) put(table + 1, 0xf0u, 0u, 0u);
      const Coded number = coded(value);
      put(table + 1, zeros << 4 | std::min(number.bits, 15u), number.tail, number.bits);
      zeros = 0;
    }
    if (zeros > 0) put(table + 1, 0u, 0u, 0u);
  }

  const JpegCoefficients& source_;
  const TexturePlane& plane_;
  std::vector<Component> components_;
  std::uint32_t most_across_ = 1, most_down_ = 1;
};

/// Tables of exactly the symbols that the stored fragments have.
HuffmanTables tables_for(const SymbolCounts& counts) {
  HuffmanTables out;
  for (const auto& count : counts) {
    Bytes symbols;
    std::vector<std::uint64_t> weights;
    for (std::size_t s = 0; s < count.size(); ++s)
      if (count[s] > 0) {
        symbols.push_back(static_cast<std::uint8_t>(s));
        weights.push_back(count[s]);
      }
    if (symbols.empty()) symbols = {0}, weights = {1};  // nothing is stored
    out.push_back(make_huffman_table(symbols, weights));
  }
  return out;
}

void put_segment(Bytes& out, std::uint8_t marker, const Bytes& payload) {
  const std::size_t length = payload.size() + 2;
  out.insert(out.end(),
             {0xff, marker, static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length)});
  out.insert(out.end(), payload.begin(), payload.end());
}

/// SOI [APP14] DQT DHT SOF0 SOS EOI.
Bytes head_of(const TexturePlane& plane, const std::vector<Component>& components, bool rgb,
              const HuffmanTables& tables) {
  Bytes out{0xff, 0xd8}, frame{8}, scan{static_cast<std::uint8_t>(components.size())};
  if (rgb) put_segment(out, 0xee, {'A', 'd', 'o', 'b', 'e', 0, 100, 0, 0, 0, 0, 0});
  for (const std::uint32_t side : {plane.fragment_height_px, plane.fragment_width_px})
    frame.insert(frame.end(), {static_cast<std::uint8_t>(side >> 8), static_cast<std::uint8_t>(side)});
  frame.push_back(static_cast<std::uint8_t>(components.size()));
  for (std::size_t c = 0; c < components.size(); ++c) {
    const auto same = std::ranges::find(components, components[c].quantisers, &Component::quantisers);
    const auto table = static_cast<std::uint8_t>(same - components.begin());
    if (table == c) {
      Bytes quantisers{table};
      for (const std::uint8_t k : kNaturalOfZigzag)
        quantisers.push_back(static_cast<std::uint8_t>(components[c].quantisers[k]));
      put_segment(out, 0xdb, quantisers);
    }
    const auto id = static_cast<std::uint8_t>(c + 1);
    frame.insert(frame.end(),
                 {id, static_cast<std::uint8_t>(components[c].across << 4 | components[c].down), table});
    scan.insert(scan.end(), {id, static_cast<std::uint8_t>(c == 0 ? 0x00 : 0x11)});
  }
  for (std::size_t t = 0; t < tables.size(); ++t) {
    Bytes codes{static_cast<std::uint8_t>(t % 2 << 4 | t / 2)};
    codes.insert(codes.end(), tables[t].bits.begin() + 1, tables[t].bits.end());
    codes.insert(codes.end(), tables[t].symbols.begin(), tables[t].symbols.end());
    put_segment(out, 0xc4, codes);
  }
  scan.insert(scan.end(), {0, 63, 0});
  put_segment(out, 0xc0, frame);
  put_segment(out, 0xda, scan);
  out.insert(out.end(), {0xff, 0xd9});
  return out;
}

/// "" where a baseline JPEG of that plane's fragments can hold the coefficients.
std::string obstacle(const JpegCoefficients& source, const TexturePlane& plane) {
  if (!source.is_plain()) return "its colours are neither grey, YCbCr nor RGB";
  const std::vector<Component> components = plain_components(source);
  if (source.width_px() != plane.width_px || source.height_px() != plane.height_px ||
      components.size() != plane.channels)
    return "it has another size or another number of channels";
  for (const Component& c : components) {
    if (c.across > 2 || c.down > 2) return "its chroma is sampled in blocks wider than 16 px";
    for (const std::uint16_t q : c.quantisers)
      if (q < 1 || q > 255) return "its quantisers exceed 255";
  }
  return "";
}

/// Counts of one fragment's symbols; false when baseline JPEG has no symbol for one of its numbers.
bool count_fragment(const FragmentScan& scan, std::size_t fragment, SymbolCounts& counts) {
  bool fits = true;
  scan.for_each_symbol(fragment, [&](std::size_t table, unsigned symbol, std::uint32_t, unsigned bits) {
    fits = fits && bits <= (table % 2 ? kMostAcBits : kMostDcBits);
    ++counts[table][symbol & 0xff];
  });
  return fits;
}

Bytes code_fragment(const FragmentScan& scan, std::size_t fragment, const std::vector<SymbolCodes>& codes) {
  constexpr std::size_t kMostSymbolBytes = 8;  // a code of 16 bits and a tail of 11, each byte escaped
  Bytes out{0xff, 0xd8};
  BitWriter writer(out);
  scan.for_each_symbol(fragment, [&](std::size_t table, unsigned symbol, std::uint32_t tail, unsigned bits) {
    writer.reserve(kMostSymbolBytes);
    writer.put(codes[table].code[symbol], codes[table].bits[symbol]);
    writer.put(tail, bits);
  });
  writer.finish();
  out.insert(out.end(), {0xff, 0xd9});
  return out;
}

/// A rung of quality 100 makes room: it is left out, or renamed where it is the only one.
PlaneLadder with_rung(PlaneLadder ladder, LadderRung rung) {
  std::vector<LadderRung>& rungs = ladder.rungs;
  if (rungs.back().quality >= kLosslessQuality && rungs.size() > 1) rungs.pop_back();
  if (rungs.back().quality >= kLosslessQuality) rungs.back().quality = kLosslessQuality - 1;
  rungs.push_back(std::move(rung));
  ladder.lossless = true;
  return ladder;
}

}  // namespace

std::optional<LadderRung> cut_coefficients(const TexturePlane& plane, const Image& image,
                                           std::string& why_not, const RunContext& context) {
  const JpegCoefficients source(image.name, image.bytes);
  why_not = obstacle(source, plane);
  if (!why_not.empty()) return std::nullopt;
  const FragmentScan scan(source, plane);
  const std::size_t fragments = plane.fragment_count(), kinds = source.components().size() == 1 ? 2 : 4;
  std::vector<SymbolCounts> counted(fragments);
  std::vector<std::uint8_t> fits(fragments, 1);
  parallel_for(context, fragments, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f) {
      if (plane.covered_texels[f] == 0) continue;
      counted[f].resize(kinds);
      fits[f] = count_fragment(scan, f, counted[f]);
    }
  });
  if (std::ranges::count(fits, 0) > 0) {
    why_not = "it has coefficients that are too large for 8-bit samples";
    return std::nullopt;
  }
  SymbolCounts counts(kinds);
  for (const SymbolCounts& one : counted)
    for (std::size_t t = 0; t < one.size(); ++t)
      for (std::size_t s = 0; s < one[t].size(); ++s) counts[t][s] += one[t][s];
  const HuffmanTables tables = tables_for(counts);
  std::vector<SymbolCodes> codes;
  for (const HuffmanTable& table : tables) codes.push_back(symbol_codes(table));
  std::vector<Bytes> streams(fragments);
  parallel_for(context, fragments, 1, [&](std::size_t begin, std::size_t end) {
    for (std::size_t f = begin; f < end; ++f)
      if (plane.covered_texels[f] > 0) streams[f] = code_fragment(scan, f, codes);
  });
  LadderRung rung{kLosslessQuality, head_of(plane, scan.components(), source.is_rgb(), tables), {}, {0}};
  for (const Bytes& stream : streams) {
    rung.data.insert(rung.data.end(), stream.begin(), stream.end());
    rung.offset.push_back(rung.data.size());
  }
  return rung;
}

PlaneLadder with_lossless_top(PlaneLadder ladder, const TexturePlane& plane, const Image& image, Notes& notes,
                              const RunContext& context) {
  if (plane.mip > 0 || plane.role == TextureRole::kAlpha) return ladder;
  RunContext quiet = context;
  quiet.progress = nullptr;
  const bool changed =
      changes_colours(image, is_colour(plane.role) ? FloatEncoding::kSrgb : FloatEncoding::kAsIs);
  std::string why_not;
  if (image.format == ImageFormat::kJpeg && ladder.codec == Codec::kJpeg && !changed)
    if (auto rung = cut_coefficients(plane, image, why_not, quiet))
      return with_rung(std::move(ladder), std::move(*rung));
  ladder.source = changed ? SourceFile::kOtherColours : SourceFile::kSameColours;
  if (!why_not.empty())
    add_info(notes, "jpeg-kept-whole", image.name, "the file is stored as it is, since " + why_not);
  return ladder;
}

}  // namespace texmesh
