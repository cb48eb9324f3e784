#include "stages/jpeg/masked_jpeg.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <utility>

#include "stages/jpeg/bit_writer.h"
#include "stages/jpeg/jpeg_samples.h"
#include "stages/jpeg/jpeg_stream.h"

namespace texmesh {
namespace {

// A bit saved may cost this many squared quantisers (mean of the first nine AC ones). Measured on three
// photogrammetry atlases: for luma .05 to .16 are within 1 % at every rung; chroma and data stand at what
// keeps their error at covered texels where plain quantisation has it, because no bytes of the figure that
// decides here, the error of luma, would show a loss.
constexpr float kLumaBitCost = 0.09f, kOtherBitCost = 0.05f;
// Of an uncovered sample, so that it does not run away; .001 to .01 make 0.1 % of the bytes.
constexpr float kUncoveredWeight = 0.003f;
// An uncovered block takes the DC before it when its own level is no further off: beside covered texels,
// where mips that a client makes by itself show it from 1/8 on, and elsewhere, where they do from 1/16 on. 12
// beside them: 0.7 % more bytes.
constexpr float kSameLevelBeside = 24, kSameLevel = 64;

// What a block takes at most: 64 symbols of 16 + 11 bits, each byte perhaps with a zero behind it.
constexpr std::size_t kMostBlockBytes = 512;

/// Writes the blocks of one rung.
class BitSink {
 public:
  BitSink(std::vector<std::uint8_t>& out, const MaskedRung& rung) : writer_(out), rung_(&rung) {}
  void begin_block(std::size_t component) {
    coding_ = &(*rung_)[component];
    writer_.reserve(kMostBlockBytes);
  }
  void dc(unsigned symbol, unsigned value) { put(coding_->dc, symbol, value, symbol); }
  void ac(unsigned symbol, unsigned value) { put(coding_->ac, symbol, value, symbol & 15u); }
  void finish() { writer_.finish(); }

 private:
  void put(const SymbolCodes& codes, unsigned symbol, unsigned value, unsigned size) {
    writer_.put(unsigned{codes.code[symbol]} << size | (value & ((1u << size) - 1)),
                codes.bits[symbol] + size);
  }
  BitWriter writer_;
  const MaskedRung* rung_;
  const BlockCoding* coding_ = nullptr;
};

class CountSink {
 public:
  CountSink(const JpegKind& kind, SymbolCounts& counts) : kind_(&kind), counts_(&counts) {}
  void begin_block(std::size_t component) { dc_ = counts_->data() + 2 * table_pair(*kind_, component); }
  void dc(unsigned symbol, unsigned) { ++(*dc_)[symbol]; }
  void ac(unsigned symbol, unsigned) { ++dc_[1][symbol]; }

 private:
  const JpegKind* kind_;
  SymbolCounts* counts_;
  SymbolCounts::value_type* dc_ = nullptr;  // and AC behind it
};

/// The symbols of a block, ISO 10918-1 F.1.2.
template <class Sink>
void emit(const CodedBlock& block, int dc_before, std::size_t component, Sink& sink) {
  const auto size = [](int v) {
    return static_cast<unsigned>(std::bit_width(static_cast<unsigned>(std::abs(v))));
  };
  const auto bits = [](int v) { return static_cast<unsigned>(v < 0 ? v - 1 : v); };
  sink.begin_block(component);
  const int step = block.values[0] - dc_before;
  sink.dc(size(step), bits(step));
  unsigned before = 0;
  for (std::uint64_t left = block.used & ~std::uint64_t{1}; left != 0; left &= left - 1) {
    const auto k = static_cast<unsigned>(std::countr_zero(left));
    const int value = block.values[k];
    unsigned zeros = k - before - 1;
    for (; zeros > 15; zeros -= 16) sink.ac(0xf0, 0);
    sink.ac(zeros << 4 | size(value), bits(value));
    before = k;
  }
  if (before < 63) sink.ac(0, 0);
}

/// How much of a block is covered, by its weights.
enum class BlockCoverage : std::uint8_t { kNothing, kPart, kAll };

BlockCoverage coverage_of(const BlockValues& weights) {
  bool all = true, any = false;
  for (const float w : weights) all &= w >= 1, any |= w > 0;
  return all ? BlockCoverage::kAll : any ? BlockCoverage::kPart : BlockCoverage::kNothing;
}

float mean_of(const BlockValues& samples) {
  std::array<float, 8> sums{};
  for (std::size_t k = 0; k < 64; ++k) sums[k % 8] += samples[k];
  float sum = 0;
  for (const float s : sums) sum += s;
  return sum / 64;
}

/// Whether a block or one of the eight around it has weight.
bool beside_coverage(const std::vector<float>& weights, std::uint32_t width, std::uint32_t height,
                     std::uint32_t left, std::uint32_t top) {
  const std::uint32_t right = std::min(left + 16, width), bottom = std::min(top + 16, height);
  for (std::uint32_t y = top > 8 ? top - 8 : 0; y < bottom; ++y) {
    const float* row = weights.data() + std::size_t{y} * width;
    if (std::any_of(row + (left > 8 ? left - 8 : 0), row + right, [](float w) { return w > 0; })) return true;
  }
  return false;
}

/// A block that nobody sees: the DC before it, unless that is further off than `same_level`.
CodedBlock flat_block(float level, float same_level, const BlockCoding& coding, int dc_before) {
  CodedBlock out;
  const float own = 8 * level / coding.quantisers[0];
  const int nearest = static_cast<int>(own < 0 ? own - 0.5f : own + 0.5f);
  const float off = static_cast<float>(nearest - dc_before) * coding.quantisers[0] / 8;
  out.values[0] = static_cast<std::int16_t>(std::fabs(off) <= same_level ? dc_before : nearest);
  return out;
}

}  // namespace

MaskedRung masked_rung(const JpegKind& kind, const std::vector<std::array<std::uint16_t, 64>>& quantisers,
                       const HuffmanTables& tables) {
  MaskedRung out(kind.channels);
  for (std::size_t c = 0; c < out.size(); ++c) {
    BlockCoding& coding = out[c];
    float square = 0;
    for (std::size_t k = 0; k < 64; ++k) {
      const float q = coding.quantisers[kNaturalOfZigzag[k]] = quantisers[c][k];
      if (k > 0 && k < 10) square += q * q / 9;
    }
    coding.bit_cost = (c == 0 && !kind.rgb ? kLumaBitCost : kOtherBitCost) * square;
    coding.dc = symbol_codes(tables[2 * table_pair(kind, c)]);
    coding.ac = symbol_codes(tables[2 * table_pair(kind, c) + 1]);
  }
  return out;
}

bool wholly_covered(const PixelWindow& image) {
  if (image.coverage.mask.empty()) return true;
  for (std::uint32_t y = 0; y < image.height_px; ++y)
    for (std::uint32_t x = 0; x < image.width_px; ++x)
      if (!image.coverage.covered(x, y)) return false;
  return true;
}

MaskedJpeg::MaskedJpeg(const JpegKind& kind)
    : kind_(kind), halved_(halves_chroma(kind)), components_(kind.channels) {}

/// A sample of halved chroma is the mean of its covered texels.
void MaskedJpeg::halve(Component& chroma) const {
  const std::uint32_t w = chroma.width;
  chroma.width /= 2, chroma.height /= 2;
  std::vector<float> values(std::size_t{chroma.width} * chroma.height);
  for (std::uint32_t y = 0; y < chroma.height; ++y) {
    const std::size_t row = std::size_t{2 * y} * w;
    for (std::uint32_t x = 0; x < chroma.width; ++x) {
      float covered = 0, all = 0, count = 0;
      for (const std::size_t at : {row + 2 * x, row + 2 * x + 1, row + w + 2 * x, row + w + 2 * x + 1})
        covered += weights_[at] * chroma.values[at], count += weights_[at], all += chroma.values[at];
      values[std::size_t{y} * chroma.width + x] = count > 0 ? covered / count : all / 4;
    }
  }
  chroma.values = std::move(values);
}

/// What bilinear interpolation (9, 3, 3 and 1 sixteenths, edges repeated) of covered texels takes from a
/// sample of halved chroma, 1 when all of them are covered.
void MaskedJpeg::weigh_halved(std::uint32_t width, std::uint32_t height) {
  halved_weights_.resize(weights_.size() / 4);
  std::vector<float> across(std::size_t{width / 2} * height);
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; x += 2) {
      const float* row = weights_.data() + std::size_t{y} * width;
      across[std::size_t{y} * (width / 2) + x / 2] =
          row[x > 0 ? x - 1 : 0] + 3 * (row[x] + row[x + 1]) + row[std::min(x + 2, width - 1)];
    }
  const std::uint32_t half = width / 2;
  for (std::uint32_t y = 0; y < height; y += 2)
    for (std::uint32_t x = 0; x < half; ++x) {
      const auto at = [&](std::uint32_t row) { return across[std::size_t{row} * half + x]; };
      halved_weights_[std::size_t{y / 2} * half + x] =
          (at(y > 0 ? y - 1 : 0) + 3 * (at(y) + at(y + 1)) + at(std::min(y + 2, height - 1))) / 64;
    }
}

void MaskedJpeg::load(const PixelWindow& image) {
  const std::uint32_t w = image.width_px, h = image.height_px;
  weights_.resize(std::size_t{w} * h);
  for (std::uint32_t y = 0; y < h; ++y)
    for (std::uint32_t x = 0; x < w; ++x)
      weights_[std::size_t{y} * w + x] =
          image.coverage.mask.empty() || image.coverage.covered(x, y) ? 1.0f : 0.0f;
  if (halved_) weigh_halved(w, h);
  for (std::size_t c = 0; c < components_.size(); ++c) {
    Component& component = components_[c];
    component.width = w, component.height = h;
    jpeg_samples(image, kind_, c, component.values);
    if (halved_ && c > 0) halve(component);
  }
}

template <class Sink>
void MaskedJpeg::code_block(std::size_t component, std::uint32_t left, std::uint32_t top,
                            std::span<const MaskedRung> rungs, std::span<Sink> sinks) {
  const Component& from = components_[component];
  const std::vector<float>& from_weights = halved_ && component > 0 ? halved_weights_ : weights_;
  BlockValues samples, weights;
  for (std::uint32_t y = 0; y < 8; ++y) {
    const std::size_t at = std::size_t{top + y} * from.width + left;
    std::memcpy(samples.data() + 8 * y, from.values.data() + at, 8 * sizeof(float));
    std::memcpy(weights.data() + 8 * y, from_weights.data() + at, 8 * sizeof(float));
  }
  const BlockCoverage what = coverage_of(weights);
  float level = 0, same_level = 0;
  if (what == BlockCoverage::kNothing) {
    level = mean_of(samples);
    same_level =
        beside_coverage(from_weights, from.width, from.height, left, top) ? kSameLevelBeside : kSameLevel;
  }
  BlockValues coefficients{};
  if (what == BlockCoverage::kAll) coefficients = block_dct(samples);
  if (what == BlockCoverage::kPart) {
    for (float& w : weights) w = std::max(w, kUncoveredWeight);
    block_.load(samples, weights);
  }
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    const BlockCoding& coding = rungs[r][component];
    int& dc = dc_before_[r][component];
    const CodedBlock block = what == BlockCoverage::kAll    ? quantise_whole(coefficients, coding)
                             : what == BlockCoverage::kPart ? block_.quantise(coding, dc)
                                                            : flat_block(level, same_level, coding, dc);
    emit(block, dc, component, sinks[r]);
    dc = block.values[0];
  }
}

template <class Sink>
void MaskedJpeg::code(const PixelWindow& image, std::span<const MaskedRung> rungs, std::span<Sink> sinks) {
  load(image);
  dc_before_.assign(rungs.size(), {});
  const std::uint32_t side = halved_ ? 16 : 8;
  for (std::uint32_t y = 0; y < image.height_px; y += side)
    for (std::uint32_t x = 0; x < image.width_px; x += side)
      for (std::size_t c = 0; c < components_.size(); ++c) {
        const bool four = halved_ && c == 0, half = halved_ && c > 0;
        for (std::uint32_t b = 0; b < (four ? 4u : 1u); ++b)
          code_block(c, (half ? x / 2 : x) + b % 2 * 8, (half ? y / 2 : y) + b / 2 * 8, rungs, sinks);
      }
}

void MaskedJpeg::append_bodies(const PixelWindow& image, std::span<const MaskedRung> rungs,
                               std::span<std::vector<std::uint8_t>> streams) {
  std::vector<BitSink> sinks;
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    streams[r].insert(streams[r].end(), {0xff, 0xd8});
    sinks.emplace_back(streams[r], rungs[r]);
  }
  code(image, rungs, std::span(sinks));
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    sinks[r].finish();
    streams[r].insert(streams[r].end(), {0xff, 0xd9});
  }
}

void MaskedJpeg::count_symbols(const PixelWindow& image, std::span<const MaskedRung> rungs,
                               std::span<SymbolCounts> counts) {
  std::vector<CountSink> sinks;
  for (SymbolCounts& c : counts) sinks.emplace_back(kind_, c);
  code(image, rungs, std::span(sinks));
}

}  // namespace texmesh
