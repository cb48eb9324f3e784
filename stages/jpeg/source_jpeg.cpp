#include "stages/jpeg/source_jpeg.h"

#include <algorithm>
#include <cmath>

#include "format/rules/size_curve.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kMostMcuBlocks = 10;  // ISO/IEC 10918-1, B.2.3

void put_segment(Bytes& out, std::uint8_t marker, const Bytes& payload) {
  const std::size_t length = payload.size() + 2;
  out.insert(out.end(),
             {0xff, marker, static_cast<std::uint8_t>(length >> 8), static_cast<std::uint8_t>(length)});
  out.insert(out.end(), payload.begin(), payload.end());
}

std::vector<SourceLayout::Component> plain_components(const JpegCoefficients& source) {
  std::vector<SourceLayout::Component> out;
  for (const JpegCoefficients::Component& c : source.components())
    out.push_back({c.across, c.down, c.blocks_across, c.blocks_down});
  const auto all = [&](std::uint32_t SourceLayout::Component::*factor) {
    return std::ranges::all_of(out,
                               [&](const SourceLayout::Component& c) { return c.*factor == out[0].*factor; });
  };
  for (const auto factor : {&SourceLayout::Component::across, &SourceLayout::Component::down})
    if (all(factor))
      for (SourceLayout::Component& c : out) c.*factor = 1;
  return out;
}

std::string obstacle(const SourceLayout& layout, std::uint32_t width_px, std::uint32_t height_px) {
  std::uint32_t blocks = 0;
  for (const SourceLayout::Component& c : layout.components) {
    for (const std::uint32_t factor : {c.across, c.down})
      if (factor != 1 && factor != 2 && factor != 4) return "its sampling factors are not 1, 2 or 4";
    blocks += c.across * c.down;
  }
  if (blocks > kMostMcuBlocks) return "its components cannot be interleaved";
  if (width_px % layout.mcu_width_px != 0 || height_px % layout.mcu_height_px != 0)
    return "its chroma is sampled in blocks that cross the borders of fragments";
  for (const SourceLayout::Quantisers& quantisers : layout.quantisers)
    for (const std::uint16_t q : quantisers)
      if (q < 1 || q > 255) return "its quantisers exceed 255";
  return "";
}

}  // namespace

std::optional<SourceLayout> source_layout(const JpegCoefficients& source, std::uint32_t fragment_width_px,
                                          std::uint32_t fragment_height_px, std::string& why_not) {
  why_not = "its colours are neither grey, YCbCr nor RGB";
  if (!source.is_plain()) return std::nullopt;
  SourceLayout out;
  out.components = plain_components(source);
  out.rgb = source.is_rgb();
  for (std::size_t c = 0; c < out.components.size(); ++c) {
    out.mcu_width_px = std::max(out.mcu_width_px, 8 * out.components[c].across);
    out.mcu_height_px = std::max(out.mcu_height_px, 8 * out.components[c].down);
    SourceLayout::Quantisers& quantisers = out.quantisers.emplace_back();
    for (std::size_t k = 0; k < 64; ++k)
      quantisers[k] = source.components()[c].quantisers[kNaturalOfZigzag[k]];
    out.pairs.push_back(c == 0 ? 0 : 1);
  }
  why_not = obstacle(out, fragment_width_px, fragment_height_px);
  if (!why_not.empty()) return std::nullopt;
  return out;
}

Bytes source_head(const SourceLayout& layout, const std::vector<SourceLayout::Quantisers>& quantisers,
                  const HuffmanTables& tables, std::uint32_t width_px, std::uint32_t height_px) {
  const std::size_t count = layout.components.size();
  Bytes out{0xff, 0xd8}, frame{8}, scan{static_cast<std::uint8_t>(count)};
  if (layout.rgb) put_segment(out, 0xee, {'A', 'd', 'o', 'b', 'e', 0, 100, 0, 0, 0, 0, 0});
  for (const std::uint32_t side : {height_px, width_px})
    frame.insert(frame.end(), {static_cast<std::uint8_t>(side >> 8), static_cast<std::uint8_t>(side)});
  frame.push_back(static_cast<std::uint8_t>(count));
  for (std::size_t c = 0; c < count; ++c) {
    const auto table =
        static_cast<std::uint8_t>(std::ranges::find(quantisers, quantisers[c]) - quantisers.begin());
    if (table == c) {
      Bytes steps{table};
      for (const std::uint16_t q : quantisers[c]) steps.push_back(static_cast<std::uint8_t>(q));
      put_segment(out, 0xdb, steps);
    }
    const SourceLayout::Component& from = layout.components[c];
    const auto id = static_cast<std::uint8_t>(c + 1);
    const auto pair = static_cast<std::uint8_t>(layout.pairs[c]);
    frame.insert(frame.end(), {id, static_cast<std::uint8_t>(from.across << 4 | from.down), table});
    scan.insert(scan.end(), {id, static_cast<std::uint8_t>(pair << 4 | pair)});
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

int quality_of(const SourceLayout::Quantisers& quantisers) {
  const double own = fineness_of(quantisers);
  int best = 1;
  for (int q = 2; q <= 100; ++q)
    if (std::fabs(fineness_at_quality(q) - own) < std::fabs(fineness_at_quality(best) - own)) best = q;
  return best;
}

}  // namespace texmesh
