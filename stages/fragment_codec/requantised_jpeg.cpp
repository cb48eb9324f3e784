#include "stages/fragment_codec/requantised_jpeg.h"

#include <algorithm>
#include <bit>
#include <cstdlib>
#include <utility>

#include "stages/jpeg/jpeg_samples.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {
namespace {

// Of samples of 8 bits. A DC within these bounds also makes steps of at most 11 bits beside flat blocks,
// which is what baseline JPEG has symbols for (ISO/IEC 10918-1, F.1.2).
constexpr int kLeastDc = -1024, kMostDc = 1023, kMostAcBits = 10;
// Of coefficients that samples of 8 bits can have. A hostile file says more, and no decoder shows it.
constexpr float kLargestCoefficient = 1023;

int bits_of(int value) { return std::bit_width(static_cast<unsigned>(std::abs(value))); }

/// A row or column of `count` samples becomes one of count / factor by a triangle of twice the factor's
/// width, which is how decoders interpolate; outermost samples are repeated. `at` gives a sample by its
/// place.
template <class At>
float triangle_mean(std::uint32_t place, std::uint32_t factor, std::uint32_t count, const At& at) {
  if (factor == 1) return at(place);
  float sum = 0;
  for (std::uint32_t d = 0; d < 2 * factor; ++d) {
    const std::int64_t from = std::int64_t{place} * factor - factor / 2 + d;
    const auto inside = static_cast<std::uint32_t>(std::clamp<std::int64_t>(from, 0, count - 1));
    sum += static_cast<float>(std::min(2 * d + 1, 4 * factor - 2 * d - 1)) * at(inside);
  }
  return sum / static_cast<float>(2 * factor * factor);
}

/// What interpolation of covered texels takes from each sample of a component; 1 where they all are covered.
void weigh(const SamplePlane& covered, std::uint32_t across, std::uint32_t down, SamplePlane& out) {
  SamplePlane rows{covered.width / across, covered.height, {}};
  rows.values.resize(std::size_t{rows.width} * rows.height);
  for (std::uint32_t y = 0; y < rows.height; ++y) {
    const float* from = covered.values.data() + std::size_t{y} * covered.width;
    for (std::uint32_t x = 0; x < rows.width; ++x)
      rows.values[std::size_t{y} * rows.width + x] =
          triangle_mean(x, across, covered.width, [&](std::uint32_t k) { return from[k]; });
  }
  out.width = rows.width, out.height = covered.height / down;
  out.values.resize(std::size_t{out.width} * out.height);
  for (std::uint32_t y = 0; y < out.height; ++y)
    for (std::uint32_t x = 0; x < out.width; ++x)
      out.values[std::size_t{y} * out.width + x] = triangle_mean(y, down, rows.height, [&](std::uint32_t k) {
        return rows.values[std::size_t{k} * rows.width + x];
      });
}

/// Means of across x down samples.
void shrink(SamplePlane& plane, std::uint32_t across, std::uint32_t down) {
  if (across * down == 1) return;
  SamplePlane out{plane.width / across, plane.height / down, {}};
  for (std::uint32_t y = 0; y < out.height; ++y)
    for (std::uint32_t x = 0; x < out.width; ++x) {
      float sum = 0;
      for (std::uint32_t v = 0; v < down; ++v)
        for (std::uint32_t u = 0; u < across; ++u)
          sum += plane.values[std::size_t{y * down + v} * plane.width + x * across + u];
      out.values.push_back(sum / static_cast<float>(across * down));
    }
  plane = std::move(out);
}

}  // namespace

struct RequantisedJpeg::Seen {
  BlockCoverage coverage = BlockCoverage::kAll;
  BlockValues coefficients{};       // of kAll and kPart
  float level = 0, same_level = 0;  // of kNothing
};

RequantisedJpeg::RequantisedJpeg(const JpegCoefficients& source, const SourceLayout& layout)
    : source_(source),
      layout_(layout),
      weights_(layout.components.size()),
      filled_(layout.components.size()) {}

void RequantisedJpeg::load(const PixelWindow& window) {
  masked_ = !window.coverage.mask.empty();
  if (!masked_) return;
  covered_.width = window.width_px, covered_.height = window.height_px;
  covered_.values.clear();
  for (std::uint32_t y = 0; y < window.height_px; ++y)
    for (std::uint32_t x = 0; x < window.width_px; ++x)
      covered_.values.push_back(window.coverage.covered(x, y) ? 1.0f : 0.0f);
  for (std::size_t c = 0; c < layout_.components.size(); ++c) load_component(window, c);
}

void RequantisedJpeg::load_component(const PixelWindow& window, std::size_t component) {
  const std::uint32_t across = layout_.most_across() / layout_.components[component].across;
  const std::uint32_t down = layout_.most_down() / layout_.components[component].down;
  weigh(covered_, across, down, weights_[component]);
  JpegKind kind;
  kind.channels = static_cast<std::uint32_t>(layout_.components.size());
  kind.rgb = layout_.rgb;
  filled_[component].width = window.width_px, filled_[component].height = window.height_px;
  jpeg_samples(window, kind, component, filled_[component].values);
  shrink(filled_[component], across, down);
}

RequantisedJpeg::Seen RequantisedJpeg::look(std::size_t component, std::uint32_t left, std::uint32_t top,
                                            const std::int16_t* coefficients) {
  Seen out;
  BlockValues weights;
  if (masked_) {
    weights = weights_[component].block(left, top);
    out.coverage = coverage_of(weights);
  }
  if (out.coverage == BlockCoverage::kNothing) {
    out.level = mean_of(filled_[component].block(left, top));
    out.same_level = same_level_at(weights_[component], left, top);
    return out;
  }
  const auto& quantisers = source_.components()[component].quantisers;
  for (std::size_t k = 0; k < 64; ++k)
    out.coefficients[k] = std::clamp(static_cast<float>(coefficients[k] * quantisers[k]),
                                     -kLargestCoefficient, kLargestCoefficient);
  if (out.coverage == BlockCoverage::kAll || exact_only_) return out;
  BlockValues samples = block_inverse_dct(out.coefficients);
  const BlockValues filled = filled_[component].block(left, top);
  for (std::size_t k = 0; k < 64; ++k) {
    if (weights[k] == 0) samples[k] = filled[k];
    weights[k] = std::max(weights[k], kUncoveredWeight);
  }
  block_.load(samples, weights);
  return out;
}

CodedBlock RequantisedJpeg::exact_block(const std::int16_t* coefficients, int dc_before) {
  CodedBlock out;
  bool fits = coefficients[0] >= kLeastDc && coefficients[0] <= kMostDc;
  for (std::size_t k = 0; k < 64; ++k) {
    out.values[k] = coefficients[kNaturalOfZigzag[k]];
    out.used |= std::uint64_t{out.values[k] != 0} << k;
    fits = fits && (k == 0 || bits_of(out.values[k]) <= kMostAcBits);
  }
  if (fits) return out;
  fits_ = false;  // nobody asks for the streams
  out = {};
  out.values[0] = static_cast<std::int16_t>(dc_before);
  return out;
}

template <class Sink>
void RequantisedJpeg::code_block(const PixelWindow& window, std::size_t component, std::uint32_t column,
                                 std::uint32_t row, std::span<const SourceRung> rungs,
                                 std::span<Sink> sinks) {
  const SourceLayout::Component& of = layout_.components[component];
  // Of the fragment's file, and of the image.
  const std::uint32_t left = 8 * column, top = 8 * row;
  const std::uint32_t image_column = window.coverage.left_px / layout_.mcu_width_px * of.across + column;
  const std::uint32_t image_row = window.coverage.top_px / layout_.mcu_height_px * of.down + row;
  const bool beyond = image_column >= of.blocks_across || image_row >= of.blocks_down;
  const std::int16_t* coefficients = beyond ? nullptr : source_.block(component, image_row, image_column);
  const Seen seen = beyond ? Seen{} : look(component, left, top, coefficients);
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    const BlockCoding& coding = rungs[r].coding[component];
    int& dc = dc_before_[r][component];
    CodedBlock block;
    if (beyond)
      block.values[0] = static_cast<std::int16_t>(dc);
    else if (seen.coverage == BlockCoverage::kNothing)
      block = flat_block(seen.level, seen.same_level, coding, dc);
    else if (rungs[r].exact)
      block = exact_block(coefficients, dc);
    else
      block = seen.coverage == BlockCoverage::kAll ? quantise_whole(seen.coefficients, coding)
                                                   : block_.quantise(coding, dc);
    emit_block(block, dc, component, sinks[r]);
    dc = block.values[0];
  }
}

template <class Sink>
void RequantisedJpeg::code(const PixelWindow& window, std::span<const SourceRung> rungs,
                           std::span<Sink> sinks) {
  load(window);
  fits_ = true;
  exact_only_ = std::ranges::all_of(rungs, &SourceRung::exact);
  dc_before_.assign(rungs.size(), {});
  for (std::uint32_t y = 0; y < window.height_px / layout_.mcu_height_px; ++y)
    for (std::uint32_t x = 0; x < window.width_px / layout_.mcu_width_px; ++x)
      for (std::size_t c = 0; c < layout_.components.size(); ++c) {
        const std::uint32_t across = layout_.components[c].across, down = layout_.components[c].down;
        for (std::uint32_t b = 0; b < across * down; ++b)
          code_block(window, c, x * across + b % across, y * down + b / across, rungs, sinks);
      }
  for (Sink& sink : sinks) sink.finish();
}

void RequantisedJpeg::append_bodies(const PixelWindow& window, std::span<const SourceRung> rungs,
                                    std::span<std::vector<std::uint8_t>> streams) {
  std::vector<BitSink> sinks;
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    streams[r].insert(streams[r].end(), {0xff, 0xd8});
    sinks.emplace_back(streams[r], rungs[r].coding);
  }
  code(window, rungs, std::span(sinks));
  for (std::size_t r = 0; r < rungs.size(); ++r) streams[r].insert(streams[r].end(), {0xff, 0xd9});
}

bool RequantisedJpeg::count_symbols(const PixelWindow& window, std::span<const SourceRung> rungs,
                                    std::span<SymbolCounts> counts) {
  std::vector<CountSink> sinks;
  for (SymbolCounts& c : counts) sinks.emplace_back(layout_.pairs, c);
  code(window, rungs, std::span(sinks));
  return fits_;
}

}  // namespace texmesh
