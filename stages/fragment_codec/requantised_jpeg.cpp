#include "stages/fragment_codec/requantised_jpeg.h"
#include "stages/jpeg/jpeg_coder.h"

namespace texmesh {
namespace {

// Of samples of 8 bits. A DC within these bounds also makes steps of at most 11 bits beside flat blocks,
// which is what baseline JPEG has symbols for (ISO/IEC 10918-1, F.1.2).
constexpr int kLeastDc = -1024, kMostDc = 1023, kMostAcBits = 10;
// Of coefficients that samples of 8 bits can have. A hostile file says more, and no decoder shows it.
constexpr float kLargestCoefficient = 1023;

/// Bit n: coefficient n is not 0.
std::uint64_t nonzero(const std::int16_t* coefficients) {
  std::uint64_t out = 0;
  for (std::size_t n = 0; n < 64; n += 4) {
    std::uint64_t four;
    std::memcpy(&four, coefficients + n, sizeof four);
    if (four == 0) continue;
    for (std::size_t k = n; k < n + 4; ++k) out |= std::uint64_t{coefficients[k] != 0} << k;
  }
  return out;
}

int bits_of(int value) { return std::bit_width(static_cast<unsigned>(std::abs(value))); }

}  // namespace

struct RequantisedJpeg::Seen {
  BlockCoverage coverage = BlockCoverage::kAll;
  BlockValues coefficients;         // of kAll and kPart, where a rung chooses coefficients
  float level = 0, same_level = 0;  // of kNothing
};

RequantisedJpeg::RequantisedJpeg(const JpegCoefficients& source, const SourceLayout& layout)
    : source_(source), layout_(layout), blocks_(layout.components.size()) {}

SampleFactors RequantisedJpeg::factors_of(std::size_t component) const {
  const SourceLayout::Component& of = layout_.components[component];
  return {layout_.most_across() / of.across, layout_.most_down() / of.down};
}

void RequantisedJpeg::load(const PixelWindow& window) {
  masked_ = !window.coverage.mask.empty();
  if (!masked_) return;
  covered_.load(window);
  for (std::size_t c = 0; c < blocks_.size(); ++c) blocks_[c].load(covered_, factors_of(c));
}

/// The window's pixels as samples of a component's block.
BlockValues RequantisedJpeg::filled_block(const PixelWindow& window, std::size_t component,
                                          std::uint32_t left, std::uint32_t top) {
  const auto [across, down] = factors_of(component);
  JpegKind kind;
  kind.channels = static_cast<std::uint32_t>(layout_.components.size());
  kind.rgb = layout_.rgb;
  PixelWindow part = window;
  part.width_px = 8 * across, part.height_px = 8 * down;
  part.data += std::size_t{top} * down * window.stride_bytes + std::size_t{left} * across * kind.channels;
  jpeg_samples(part, kind, component, samples_);
  BlockValues out;
  for (std::uint32_t y = 0; y < 8; ++y)
    for (std::uint32_t x = 0; x < 8; ++x) {
      float sum = 0;
      for (std::uint32_t v = 0; v < down; ++v)
        for (std::uint32_t u = 0; u < across; ++u)
          sum += samples_[(std::size_t{y} * down + v) * part.width_px + x * across + u];
      out[8 * y + x] = sum / static_cast<float>(across * down);
    }
  return out;
}

RequantisedJpeg::Seen RequantisedJpeg::look(const PixelWindow& window, std::size_t component,
                                            std::uint32_t left, std::uint32_t top,
                                            const std::int16_t* coefficients) {
  Seen out;
  if (masked_) out.coverage = blocks_[component].at(left, top);
  if (out.coverage == BlockCoverage::kNothing) {
    out.level = mean_of(filled_block(window, component, left, top));
    out.same_level = blocks_[component].same_level_at(left, top);
    return out;
  }
  if (exact_only_) return out;
  const auto& quantisers = source_.components()[component].quantisers;
  for (std::size_t k = 0; k < 64; ++k)
    out.coefficients[k] = std::clamp(static_cast<float>(coefficients[k] * quantisers[k]),
                                     -kLargestCoefficient, kLargestCoefficient);
  if (out.coverage == BlockCoverage::kAll) return out;
  BlockValues samples = block_inverse_dct(out.coefficients);
  BlockValues weights = covered_.weights(factors_of(component), left, top);
  const BlockValues filled = filled_block(window, component, left, top);
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
  for (std::uint64_t left = nonzero(coefficients); left != 0; left &= left - 1) {
    const auto n = static_cast<std::size_t>(std::countr_zero(left));
    const std::size_t k = kZigzagOfNatural[n];
    out.values[k] = coefficients[n];
    out.used |= std::uint64_t{1} << k;
    fits = fits && (k == 0 || bits_of(coefficients[n]) <= kMostAcBits);
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
  const Seen seen = beyond ? Seen{} : look(window, component, left, top, coefficients);
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
