#include "stages/masked_jpeg.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "stages/jpeg_stream.h"

namespace texmesh {
namespace {

// A bit saved may cost this many squared quantisers (mean of the first nine AC ones). Measured on three
// photogrammetry atlases: for luma .05 to .16 are within 1 % at every rung; chroma and data stand at what
// keeps their error at covered texels where plain quantisation has it, because no bytes of the figure that
// decides here, the error of luma, would show a loss.
constexpr float kLumaBitCost = 0.09f, kOtherBitCost = 0.05f;
// Of an uncovered sample, so that it does not run away; .001 to .01 make 0.1 % of the bytes.
constexpr float kUncoveredWeight = 0.003f;
// An uncovered block takes the DC before it when its own level is no further off. It shows in mips that a
// client makes by itself: of 1/4 where a chart ends at a block's border, else of 1/16. 64 saves 0.5 % more.
constexpr float kSameLevel = 24;

SymbolCodes codes_of(const HuffmanTable& table) {
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

std::size_t table_pair(const JpegKind& kind, std::size_t component) {
  return component > (kind.rgb ? 1u : 0u) ? 1 : 0;  // as JpegCoder
}

/// Writes entropy-coded bits, with a zero behind every 0xFF.
class BitSink {
 public:
  BitSink(std::vector<std::uint8_t>& out, const MaskedRung& rung) : out_(&out), rung_(&rung) {}
  void dc(std::size_t component, unsigned symbol, unsigned value) {
    put((*rung_)[component].dc, symbol, value, symbol);
  }
  void ac(std::size_t component, unsigned symbol, unsigned value) {
    put((*rung_)[component].ac, symbol, value, symbol & 15u);
  }
  /// The last byte is filled with ones.
  void finish() {
    if (count_ > 0) add((1u << (8 - count_)) - 1, 8 - count_);
  }

 private:
  void put(const SymbolCodes& codes, unsigned symbol, unsigned value, unsigned size) {
    add(codes.code[symbol], codes.bits[symbol]);
    if (size > 0) add(value & ((1u << size) - 1), size);
  }
  void add(unsigned value, unsigned count) {
    held_ = held_ << count | value;
    for (count_ += count; count_ >= 8;) {
      count_ -= 8;
      const auto byte = static_cast<std::uint8_t>(held_ >> count_);
      out_->push_back(byte);
      if (byte == 0xff) out_->push_back(0);
    }
  }
  std::vector<std::uint8_t>* out_;
  const MaskedRung* rung_;
  std::uint64_t held_ = 0;
  unsigned count_ = 0;
};

class CountSink {
 public:
  CountSink(const JpegKind& kind, SymbolCounts& counts) : kind_(&kind), counts_(&counts) {}
  void dc(std::size_t component, unsigned symbol, unsigned) {
    ++(*counts_)[2 * table_pair(*kind_, component)][symbol];
  }
  void ac(std::size_t component, unsigned symbol, unsigned) {
    ++(*counts_)[2 * table_pair(*kind_, component) + 1][symbol];
  }

 private:
  const JpegKind* kind_;
  SymbolCounts* counts_;
};

/// The symbols of a block, ISO 10918-1 F.1.2.
template <class Sink>
void emit(const CodedBlock& block, int dc_before, std::size_t component, Sink& sink) {
  const auto size = [](int v) {
    return static_cast<unsigned>(std::bit_width(static_cast<unsigned>(std::abs(v))));
  };
  const auto bits = [](int v) { return static_cast<unsigned>(v < 0 ? v - 1 : v); };
  const int step = block.values[0] - dc_before;
  sink.dc(component, size(step), bits(step));
  unsigned before = 0;
  for (std::uint64_t left = block.used & ~std::uint64_t{1}; left != 0; left &= left - 1) {
    const auto k = static_cast<unsigned>(std::countr_zero(left));
    const int value = block.values[k];
    unsigned zeros = k - before - 1;
    for (; zeros > 15; zeros -= 16) sink.ac(component, 0xf0, 0);
    sink.ac(component, zeros << 4 | size(value), bits(value));
    before = k;
  }
  if (before < 63) sink.ac(component, 0, 0);
}

/// A component's samples as JPEG has them before chroma is halved, less 128. In libjpeg's integers.
void component_values(const PixelWindow& image, const JpegKind& kind, std::size_t component,
                      std::vector<float>& out) {
  constexpr int kWeights[3][3] = {{19595, 38470, 7471}, {-11059, -21709, 32768}, {32768, -27439, -5329}};
  constexpr int kOffset[3] = {32768 - (128 << 16), 32767, 32767};
  out.resize(std::size_t{image.width_px} * image.height_px);
  const int *m = kWeights[component], offset = kOffset[component];
  float* to = out.data();
  for (std::uint32_t y = 0; y < image.height_px; ++y) {
    const std::uint8_t* p = image.data + y * image.stride_bytes;
    if (kind.channels == 1 || kind.rgb)
      for (std::uint32_t x = 0; x < image.width_px; ++x, p += kind.channels)
        *to++ = static_cast<float>(p[component] - 128);
    else
      for (std::uint32_t x = 0; x < image.width_px; ++x, p += 3)
        *to++ = static_cast<float>((m[0] * p[0] + m[1] * p[1] + m[2] * p[2] + offset) >> 16);
  }
}

/// What blocks are, by their weights.
enum class Seen : std::uint8_t { kNothing, kPart, kAll };

Seen seen(const BlockValues& weights) {
  float sum = 0, least = 1;
  for (const float w : weights) sum += w, least = std::min(least, w);
  return least >= 1 ? Seen::kAll : sum > 0 ? Seen::kPart : Seen::kNothing;
}

/// A block that nobody sees.
CodedBlock flat_block(float level, const BlockCoding& coding, int dc_before) {
  CodedBlock out;
  const float own = 8 * level / coding.quantisers[0];
  const int nearest = static_cast<int>(own < 0 ? own - 0.5f : own + 0.5f);
  const float off = static_cast<float>(nearest - dc_before) * coding.quantisers[0] / 8;
  out.values[0] = static_cast<std::int16_t>(std::fabs(off) <= kSameLevel ? dc_before : nearest);
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
    coding.dc = codes_of(tables[2 * table_pair(kind, c)]);
    coding.ac = codes_of(tables[2 * table_pair(kind, c) + 1]);
  }
  return out;
}

bool wholly_covered(const PixelWindow& image) {
  if (image.coverage.bits == nullptr) return true;
  for (std::uint32_t y = 0; y < image.height_px; ++y)
    for (std::uint32_t x = 0; x < image.width_px; ++x)
      if (!image.coverage.covered(x, y)) return false;
  return true;
}

MaskedJpeg::MaskedJpeg(const JpegKind& kind)
    : kind_(kind),
      halved_(kind.channels == 3 && !kind.rgb && kind.subsampling == Subsampling::k420),
      components_(kind.channels) {}

/// A sample of halved chroma is the mean of its covered texels. Its weight: what bilinear interpolation (9,
/// 3, 3 and 1 sixteenths, edges repeated) of covered texels takes from it, 1 when all of them are covered.
void MaskedJpeg::halve(const std::vector<float>& mask, Component& chroma, std::vector<float>& weights) const {
  const std::uint32_t w = chroma.width, h = chroma.height;
  chroma.width /= 2, chroma.height /= 2;
  std::vector<float> values(std::size_t{chroma.width} * chroma.height);
  const bool weigh = weights.empty();
  if (weigh) weights.resize(values.size());
  for (std::uint32_t y = 0; y < chroma.height; ++y)
    for (std::uint32_t x = 0; x < chroma.width; ++x) {
      const std::size_t to = std::size_t{y} * chroma.width + x;
      float covered = 0, all = 0, count = 0;
      for (std::uint32_t t = 0; t < 4; ++t) {
        const std::size_t at = std::size_t{2 * y + t / 2} * w + 2 * x + t % 2;
        covered += mask[at] * chroma.values[at], count += mask[at], all += chroma.values[at];
      }
      values[to] = count > 0 ? covered / count : all / 4;
      if (!weigh) continue;
      float taken = 0;
      for (std::uint32_t v = 0; v < 4; ++v)
        for (std::uint32_t u = 0; u < 4; ++u) {
          const std::uint32_t row = std::clamp(2 * y + v, 1u, h) - 1,
                              column = std::clamp(2 * x + u, 1u, w) - 1;
          taken += mask[std::size_t{row} * w + column] * (v % 3 ? 3.0f : 1.0f) * (u % 3 ? 3.0f : 1.0f);
        }
      weights[to] = taken / 64;
    }
  chroma.values = std::move(values);
}

void MaskedJpeg::load(const PixelWindow& image) {
  const std::uint32_t w = image.width_px, h = image.height_px;
  std::vector<float> mask(std::size_t{w} * h), half;
  for (std::uint32_t y = 0; y < h; ++y)
    for (std::uint32_t x = 0; x < w; ++x)
      mask[std::size_t{y} * w + x] = image.coverage.bits == nullptr || image.coverage.covered(x, y) ? 1 : 0;
  for (std::size_t c = 0; c < components_.size(); ++c) {
    Component& component = components_[c];
    component.width = w, component.height = h;
    component_values(image, kind_, c, component.values);
    if (halved_ && c > 0) halve(mask, component, half);
    component.weights = halved_ && c > 0 ? half : mask;
  }
}

template <class Sink>
void MaskedJpeg::code_block(std::size_t component, std::uint32_t left, std::uint32_t top,
                            std::span<const MaskedRung> rungs, std::span<Sink> sinks) {
  const Component& from = components_[component];
  BlockValues samples, weights;
  float level = 0;
  for (std::uint32_t k = 0; k < 64; ++k) {
    const std::size_t at = std::size_t{top + k / 8} * from.width + left + k % 8;
    samples[k] = from.values[at], weights[k] = from.weights[at];
    level += samples[k] / 64;
  }
  const Seen what = seen(weights);
  BlockValues coefficients{};
  if (what == Seen::kAll) coefficients = block_dct(samples);
  if (what == Seen::kPart) {
    for (float& w : weights) w = std::max(w, kUncoveredWeight);
    block_.load(samples, weights);
  }
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    const BlockCoding& coding = rungs[r][component];
    int& dc = dc_before_[r][component];
    const CodedBlock block = what == Seen::kAll    ? quantise_whole(coefficients, coding)
                             : what == Seen::kPart ? block_.quantise(coding, dc)
                                                   : flat_block(level, coding, dc);
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

void MaskedJpeg::count_symbols(const PixelWindow& image, const MaskedRung& rung, SymbolCounts& counts) {
  CountSink sink(kind_, counts);
  code(image, std::span(&rung, 1), std::span(&sink, 1));
}

}  // namespace texmesh
