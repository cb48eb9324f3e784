#include "stages/jpeg/source_jpeg.h"

#include <cmath>
#include <cstdlib>

#include "format/rules/size_curve.h"
#include "stages/base/parallel.h"
#include "stages/jpeg/jpeg_coder.h"

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

std::uint32_t divided_up(std::uint64_t a, std::uint64_t b) {
  return static_cast<std::uint32_t>((a + b - 1) / b);
}

struct TexelRange {
  std::int64_t begin, end;
};

bool shows_any(const CoverageMask& mask, TexelRange x, TexelRange y) {
  x = {std::max<std::int64_t>(x.begin, 0), std::min<std::int64_t>(x.end, mask.width_px)};
  y = {std::max<std::int64_t>(y.begin, 0), std::min<std::int64_t>(y.end, mask.height_px)};
  for (auto v = static_cast<std::uint32_t>(y.begin); v < y.end; ++v)
    for (auto u = static_cast<std::uint32_t>(x.begin); u < x.end;) {
      const bool whole = u % 8 == 0 && u + 8 <= x.end;
      if (whole ? mask.byte_at(u, v) != 0 : mask.covered(u, v)) return true;
      u += whole ? 8 : 1;
    }
  return false;
}

std::int16_t requantised(std::int16_t value, std::uint16_t from, std::uint16_t to) {
  const int product = std::abs(int{value}) * from, rounded = (2 * product + to) / (2 * to);
  return static_cast<std::int16_t>(value < 0 ? -rounded : rounded);
}

[[noreturn]] void fail_fragment(const JpegFragments& fragments, std::size_t fragment, std::string expected) {
  throw FormatError(fragments.entry, "fragment " + std::to_string(fragment), std::move(expected), "another");
}

JpegCoefficients coefficients_of(const JpegFragments& fragments, std::size_t fragment) {
  try {
    return JpegCoefficients(fragments.entry, fragments.file(fragment));
  } catch (const InputError& e) {  // of no model, but of the package
    throw FormatError(fragments.entry, "fragment " + std::to_string(fragment) + ", " + e.place(),
                      e.expected(), e.found());
  }
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

JoinedJpeg::JoinedJpeg(const JpegFragments& from, const RunContext& context)
    : width_px_(from.width_px),
      height_px_(from.height_px),
      fragment_width_px_(from.fragment_width_px),
      fragment_height_px_(from.fragment_height_px),
      columns_(from.columns) {
  std::vector<std::size_t> parts;
  for (std::size_t f = 0; f < from.stored.size(); ++f)
    if (from.stored[f]) parts.push_back(f);
  if (parts.empty()) throw FormatError(from.entry, "", "a stored fragment", "none");
  set_components(from, parts.front());
  parallel_each(context, parts.size(), 1, [&](std::size_t i) { put_fragment(from, parts[i]); });
  fill_gaps(from.stored);
}

std::array<std::uint32_t, 2> JoinedJpeg::mcu_px() const {
  std::array<std::uint32_t, 2> out{8, 8};
  for (const Component& c : components_) out = {std::max(out[0], 8 * c.across), std::max(out[1], 8 * c.down)};
  return out;
}

void JoinedJpeg::set_components(const JpegFragments& fragments, std::size_t first) {
  const JpegCoefficients one = coefficients_of(fragments, first);
  if (!one.is_plain() || one.components().size() != fragments.channels)
    fail_fragment(fragments, first, "a grey, YCbCr or RGB JPEG with the plane's channels");
  rgb_ = one.is_rgb();
  for (const JpegCoefficients::Component& from : one.components()) {
    Component& to = components_.emplace_back();
    // What is sampled alone is not subsampled, whatever its factors say.
    to.across = one.components().size() == 1 ? 1 : from.across;
    to.down = one.components().size() == 1 ? 1 : from.down;
    to.quantisers = from.quantisers;
  }
  const auto [mcu_width, mcu_height] = mcu_px();
  if (fragment_width_px_ % mcu_width != 0 || fragment_height_px_ % mcu_height != 0)
    fail_fragment(fragments, first, "sides of whole MCUs");
  for (Component& c : components_) {
    c.blocks_across = divided_up(std::uint64_t{width_px_} * c.across, mcu_width);
    c.blocks_down = divided_up(std::uint64_t{height_px_} * c.down, mcu_height);
    c.blocks.resize(std::size_t{c.blocks_across} * c.blocks_down);
  }
}

void JoinedJpeg::put_fragment(const JpegFragments& fragments, std::size_t fragment) {
  const JpegCoefficients from = coefficients_of(fragments, fragment);
  if (from.width_px() != fragment_width_px_ || from.height_px() != fragment_height_px_ ||
      from.components().size() != components_.size() || from.is_rgb() != rgb_)
    fail_fragment(fragments, fragment, "a fragment like the first one");
  const auto [mcu_width, mcu_height] = mcu_px();
  const auto column = static_cast<std::uint32_t>(fragment % columns_),
             row = static_cast<std::uint32_t>(fragment / columns_);
  for (std::size_t c = 0; c < components_.size(); ++c) {
    Component& to = components_[c];
    if (from.components()[c].quantisers != to.quantisers)
      fail_fragment(fragments, fragment, "the first one's quantisers");
    const std::uint32_t across = fragment_width_px_ / mcu_width * to.across,
                        down = fragment_height_px_ / mcu_height * to.down;
    for (std::uint32_t y = 0; y < down && row * down + y < to.blocks_down; ++y)
      for (std::uint32_t x = 0; x < across && column * across + x < to.blocks_across; ++x)
        std::copy_n(from.block(c, y, x), 64,
                    to.blocks[std::size_t{row * down + y} * to.blocks_across + column * across + x].begin());
  }
}

void JoinedJpeg::fill_gaps(const std::vector<std::uint8_t>& stored) {
  const auto [mcu_width, mcu_height] = mcu_px();
  for (Component& c : components_) {
    const std::uint32_t across = fragment_width_px_ / mcu_width * c.across,
                        down = fragment_height_px_ / mcu_height * c.down;
    for (std::uint32_t y = 0; y < c.blocks_down; ++y)
      for (std::uint32_t x = 0; x < c.blocks_across; ++x) {
        if (stored[std::size_t{y / down} * columns_ + x / across]) continue;
        const std::size_t at = std::size_t{y} * c.blocks_across + x;
        if (at > 0) c.blocks[at][0] = c.blocks[x > 0 ? at - 1 : at - c.blocks_across][0];
      }
  }
}

void JoinedJpeg::fill_unseen(const std::vector<std::uint8_t>& coverage) {
  const CoverageMask mask(coverage, width_px_, height_px_);
  for (Component& c : components_) continue_means(c, known_blocks(c, mask));
  flatten(mask);
}

/// By block: 1 where a sample is read for a covered texel, by decoders that interpolate, or where the block
/// holds more than a mean.
std::vector<std::uint8_t> JoinedJpeg::known_blocks(const Component& c, const CoverageMask& mask) const {
  const auto [mcu_width, mcu_height] = mcu_px();
  const std::int64_t wide = mcu_width / c.across, high = mcu_height / c.down;  // texels of a block
  const std::int64_t beside_x = wide / 8 - 1, beside_y = high / 8 - 1;
  std::vector<std::uint8_t> out(c.blocks.size());
  for (std::uint32_t y = 0; y < c.blocks_down; ++y)
    for (std::uint32_t x = 0; x < c.blocks_across; ++x) {
      const std::size_t at = std::size_t{y} * c.blocks_across + x;
      const Block& block = c.blocks[at];
      const bool more = std::any_of(block.begin() + 1, block.end(), [](std::int16_t v) { return v != 0; });
      out[at] = more || shows_any(mask, {x * wide - beside_x, (x + 1) * wide + beside_x},
                                  {y * high - beside_y, (y + 1) * high + beside_y});
    }
  return out;
}

void JoinedJpeg::continue_means(Component& c, std::vector<std::uint8_t> known) {
  const auto beside = [&](std::size_t at, const auto& visit) {
    const std::size_t x = at % c.blocks_across, y = at / c.blocks_across;
    for (std::size_t v = y - std::min<std::size_t>(y, 1); v < std::min<std::size_t>(y + 2, c.blocks_down);
         ++v)
      for (std::size_t u = x - std::min<std::size_t>(x, 1); u < std::min<std::size_t>(x + 2, c.blocks_across);
           ++u)
        visit(v * c.blocks_across + u);
  };
  std::vector<std::size_t> ring, next;
  for (std::size_t at = 0; at < known.size(); ++at)
    if (known[at]) ring.push_back(at);
  constexpr std::uint8_t kWaits = 2;
  for (; !ring.empty(); std::swap(ring, next)) {
    next.clear();
    for (const std::size_t at : ring)
      beside(at, [&](std::size_t other) {
        if (known[other] == 0) known[other] = kWaits, next.push_back(other);
      });
    for (const std::size_t at : next) {
      int sum = 0, count = 0;
      beside(at, [&](std::size_t other) {
        if (known[other] == 1) sum += c.blocks[other][0], ++count;
      });
      c.blocks[at][0] = static_cast<std::int16_t>(sum / count);
    }
    for (const std::size_t at : next) known[at] = 1;
  }
}

void JoinedJpeg::flatten(const CoverageMask& mask) {
  const auto [mcu_width, mcu_height] = mcu_px();
  const std::uint32_t across = divided_up(width_px_, mcu_width), down = divided_up(height_px_, mcu_height);
  // With a border of one on each side, so that every MCU has neighbours.
  std::vector<std::uint8_t> near(std::size_t{across + 2} * (down + 2));
  for (std::uint32_t y = 0; y < height_px_; ++y)
    for (std::uint32_t x = 0; x < width_px_; ++x) {
      if (!mask.covered(x, y)) continue;
      const std::size_t corner = std::size_t{y / mcu_height} * (across + 2) + x / mcu_width;
      for (std::size_t j = 0; j < 3; ++j)
        std::fill_n(near.begin() + static_cast<std::ptrdiff_t>(corner + j * (across + 2)), 3,
                    std::uint8_t{1});
      x = std::min(x / mcu_width * mcu_width + mcu_width, width_px_) - 1;
    }
  for (Component& c : components_)
    for (std::uint32_t y = 0; y < c.blocks_down; ++y)
      for (std::uint32_t x = 0; x < c.blocks_across; ++x) {
        if (near[std::size_t{y / c.down + 1} * (across + 2) + x / c.across + 1]) continue;
        Block& block = c.blocks[std::size_t{y} * c.blocks_across + x];
        std::fill(block.begin() + 1, block.end(), std::int16_t{0});
      }
}

std::vector<std::uint8_t> JoinedJpeg::file(double quality) const {
  CoefficientFile out{width_px_, height_px_, rgb_, {}};
  std::vector<std::vector<Block>> coarser(components_.size());
  for (std::size_t c = 0; c < components_.size(); ++c) {
    const Component& from = components_[c];
    out.parts.push_back({from.across, from.down, from.blocks_across, from.blocks_down, from.quantisers,
                         from.blocks[0].data()});
    CoefficientFile::Part& part = out.parts.back();
    for (std::size_t k = 0; k < 64; ++k)
      part.steps[k] = std::max(part.steps[k], texture_step(k, std::clamp(quality, 1.0, 100.0)));
    if (part.steps == from.quantisers) continue;
    coarser[c] = from.blocks;
    for (Block& block : coarser[c])
      for (std::size_t k = 0; k < 64; ++k)
        if (part.steps[k] != from.quantisers[k])
          block[k] = requantised(block[k], from.quantisers[k], part.steps[k]);
    part.blocks = coarser[c][0].data();
  }
  return jpeg_of_coefficients(out);
}

}  // namespace texmesh
