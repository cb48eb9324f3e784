#include "stages/jpeg/masked_jpeg.h"

#include <mutex>

#include "format/base/vec.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

constexpr SampleFactors kHalved{2, 2};

constexpr int kParts = 8;                    // coefficients are eighths, as libjpeg's transform gives them
constexpr std::size_t kWindowsPerTask = 32;  // whose blocks stay in the cache while qualities go by
// What MaskedJpeg saves, in bits, when it leaves out a coefficient of 1: one that others follow, and the last
// one with the zeros before it; and when it makes a larger one smaller. Fitted on four atlases of scans,
// whose bytes between rungs they give within .8 %; 3, 3 and 1: within 1.0, 4, 4 and 1: within 2.1.
constexpr float kInnerBits = 2.5f, kLastBits = 3, kZeroBits = 1, kSmallerGuessBits = 2;

/// Magnitudes of a block's coefficients in eighths, the first one 0. The k-th of the file's order stands at
/// [k % 8 * 8 + k / 8], so that one comparison of eight values gives a bit of eight bytes of a mask.
using Magnitudes = std::array<std::uint16_t, 64>;
constexpr std::size_t place_of(std::size_t k) { return k % 8 * 8 + k / 8; }

/// Some blocks of one component in the order in which they are coded.
struct Blocks {
  std::vector<Magnitudes> ac;
  std::vector<int> dc;  // in eighths
};

void add_block(const BlockValues& samples, Blocks& out) {
  const BlockValues coefficients = block_dct(samples);
  Magnitudes& magnitudes = out.ac.emplace_back();
  for (std::size_t k = 1; k < 64; ++k)
    magnitudes[place_of(k)] =
        static_cast<std::uint16_t>(std::abs(nearest_integer(kParts * coefficients[kNaturalOfZigzag[k]])));
  out.dc.push_back(nearest_integer(kParts * coefficients[0]));
}

/// Means of 2 x 2 samples, rounded as libjpeg does: down and up in turn.
std::vector<float> halved_samples(const std::vector<float>& samples, std::uint32_t width,
                                  std::uint32_t height) {
  std::vector<float> out;
  for (std::uint32_t y = 0; y < height; y += 2)
    for (std::uint32_t x = 0; x < width; x += 2) {
      const float* row = samples.data() + std::size_t{y} * width + x;
      const int sum = static_cast<int>(row[0] + row[1] + row[width] + row[width + 1]);
      out.push_back(static_cast<float>((sum + 1 + static_cast<int>(x / 2 % 2)) >> 2));
    }
  return out;
}

bool any_covered(const CoverageWindow& coverage, std::uint32_t left, std::uint32_t top, std::uint32_t width,
                 std::uint32_t height) {
  if (coverage.mask.empty()) return true;
  for (std::uint32_t y = top; y < top + height; ++y)
    for (std::uint32_t x = left; x < left + width; ++x)
      if (coverage.covered(x, y)) return true;
  return false;
}

Blocks blocks_of(const PixelWindow& image, const JpegKind& kind, std::size_t component) {
  const bool halved = halves_chroma(kind) && component > 0;
  const std::uint32_t scale = halved ? 2 : 1, width = image.width_px / scale,
                      height = image.height_px / scale;
  std::vector<float> samples;
  jpeg_samples(image, kind, component, samples);
  if (halved) samples = halved_samples(samples, image.width_px, image.height_px);
  const std::uint32_t side = halves_chroma(kind) && !halved ? 16 : 8;
  Blocks out;
  for (std::uint32_t top = 0; top < height; top += side)
    for (std::uint32_t left = 0; left < width; left += side)
      for (std::uint32_t b = 0; b < side * side / 64; ++b) {
        const std::uint32_t x = left + b % 2 * 8, y = top + b / 2 * 8;
        if (!any_covered(image.coverage, x * scale, y * scale, 8 * scale, 8 * scale)) continue;
        BlockValues block;
        for (std::size_t row = 0; row < 8; ++row)
          std::memcpy(block.data() + 8 * row, samples.data() + (y + row) * width + x, 8 * sizeof(float));
        add_block(block, out);
      }
  return out;
}

/// What a window into a source's image has of one component.
Blocks source_blocks(const JpegCoefficients& source, const SourceLayout& layout, const PixelWindow& window,
                     std::size_t component) {
  const SourceLayout::Component& of = layout.components[component];
  const auto& quantisers = source.components()[component].quantisers;
  const std::uint32_t width = layout.mcu_width_px / of.across, height = layout.mcu_height_px / of.down;
  const std::uint32_t first_column = window.coverage.left_px / layout.mcu_width_px * of.across;
  const std::uint32_t first_row = window.coverage.top_px / layout.mcu_height_px * of.down;
  constexpr int kLargest = 1023;
  Blocks out;
  for (std::uint32_t y = 0; y < window.height_px; y += layout.mcu_height_px)
    for (std::uint32_t x = 0; x < window.width_px; x += layout.mcu_width_px)
      for (std::uint32_t b = 0; b < of.across * of.down; ++b) {
        const std::uint32_t left = x + b % of.across * width, top = y + b / of.across * height;
        const std::uint32_t column = first_column + left / width, row = first_row + top / height;
        if (column >= of.blocks_across || row >= of.blocks_down) continue;
        if (!any_covered(window.coverage, left, top, width, height)) continue;
        const std::int16_t* block = source.block(component, row, column);
        const auto value = [&](std::size_t n) {
          return kParts * std::clamp(block[n] * quantisers[n], -kLargest, kLargest);
        };
        Magnitudes& magnitudes = out.ac.emplace_back();
        for (std::size_t k = 1; k < 64; ++k)
          magnitudes[place_of(k)] = static_cast<std::uint16_t>(std::abs(value(kNaturalOfZigzag[k])));
        out.dc.push_back(value(0));
      }
  return out;
}

/// How one component's coefficients become whole numbers at one quality.
class Quantiser {
 public:
  /// `bit_cost` as BlockCoding has it, 0: no coefficient is left out.
  Quantiser(const std::array<std::uint16_t, 64>& zigzag, float bit_cost) : leaves_out_(bit_cost > 0) {
    for (std::size_t k = 0; k < 64; ++k) {
      const std::uint32_t step = std::uint32_t{zigzag[k]} * kParts;
      // Half a step off, a value costs the squared error of the next one, and in proportion around it.
      const float per_bit = k > 0 ? bit_cost * kParts / static_cast<float>(2 * zigzag[k]) : 0;
      const auto up = [&](float bits) {
        return leaves_out_ && k > 0 ? static_cast<std::uint32_t>(bits * per_bit) + 1 : 0u;
      };
      add_[k] = step / 2 - std::min(up(kSmallerGuessBits), step / 2);
      share_[k] = ((1u << kShift) + step - 1) / step;
      least_[place_of(k)] = static_cast<std::int16_t>(std::min(step - step / 2 + up(kInnerBits), 32767u));
      last_[k] = static_cast<float>(step - step / 2) + kLastBits * per_bit;
      zero_[k] = kZeroBits * per_bit;
    }
  }

  std::uint32_t of(std::size_t k, std::uint32_t magnitude) const {
    return static_cast<std::uint32_t>(std::uint64_t{magnitude + add_[k]} * share_[k] >> kShift);
  }

  /// Bit k: the k-th coefficient of the file's order is coded.
  std::uint64_t coded(const Magnitudes& block) const {
    std::uint64_t mask = not_small(block);
    while (leaves_out_ && mask != 0) {
      const auto k = static_cast<unsigned>(63 - std::countl_zero(mask));
      const std::uint64_t others = mask ^ std::uint64_t{1} << k;
      const unsigned zeros = k - 1 - (others != 0 ? static_cast<unsigned>(63 - std::countl_zero(others)) : 0);
      if (static_cast<float>(block[place_of(k)]) >= last_[k] + zero_[k] * static_cast<float>(zeros)) break;
      mask = others;
    }
    return mask;
  }

 private:
  static constexpr int kShift = 26;  // exact for sums below 2^15 and steps below 2^11

  std::uint64_t not_small(const Magnitudes& block) const {
    using Eight = std::int16_t __attribute__((vector_size(16)));
    using Bytes = std::uint8_t __attribute__((vector_size(8)));
    Eight bits{}, bit{1, 1, 1, 1, 1, 1, 1, 1};
#pragma GCC unroll 8
    for (std::size_t k = 0; k < 8; ++k, bit += bit) {
      Eight value, least;
      std::memcpy(&value, block.data() + 8 * k, sizeof value);
      std::memcpy(&least, least_.data() + 8 * k, sizeof least);
      bits |= (value >= least) & bit;
    }
    const Bytes bytes = __builtin_convertvector(bits, Bytes);
    std::uint64_t mask;
    std::memcpy(&mask, &bytes, sizeof mask);
    return mask;
  }

  bool leaves_out_;
  std::array<std::int16_t, 64> least_{};           // what is coded at least, placed as Magnitudes
  std::array<std::uint32_t, 64> add_{}, share_{};  // of the file's order
  std::array<float, 64> last_{}, zero_{};
};

/// Of the components of one quality: of windows without and with coverage.
struct Quantisers {
  std::vector<Quantiser> plain, masked;
};

Quantisers quantisers_at(JpegKind kind, int quality) {
  kind.quality = quality;
  const JpegCoder coder(kind);
  const auto steps = coder.quantisers();
  const MaskedRung rung = masked_rung(kind, steps, coder.tables());
  Quantisers out;
  for (std::size_t c = 0; c < steps.size(); ++c) {
    out.plain.emplace_back(steps[c], 0.0f);
    out.masked.emplace_back(steps[c], rung[c].bit_cost);
  }
  return out;
}

/// How often symbols are coded with one table, and with those of one quality.
using Counts = std::array<std::uint32_t, 256>;
using TableCounts = std::array<Counts, 4>;

void count_magnitudes(const Magnitudes& block, const Quantiser& quantiser, Counts& ac) {
  unsigned next = 1;
  for (std::uint64_t left = quantiser.coded(block); left != 0; left &= left - 1) {
    const auto k = static_cast<unsigned>(std::countr_zero(left));
    unsigned zeros = k - next;
    for (; zeros > 15; zeros -= 16) ++ac[0xf0];
    const std::uint32_t value = std::max(quantiser.of(k, block[place_of(k)]), 1u);
    ++ac[zeros << 4 | static_cast<unsigned>(std::bit_width(value))];
    next = k + 1;
  }
  if (next < 64) ++ac[0];
}

void count_blocks(const Blocks& blocks, const Quantiser& quantiser, Counts& dc, Counts& ac) {
  const auto level = [&](std::size_t b) {
    const auto size = static_cast<int>(quantiser.of(0, static_cast<std::uint32_t>(std::abs(blocks.dc[b]))));
    return blocks.dc[b] < 0 ? -size : size;
  };
  // Windows are pieces of images: what stands before their first block is taken to be like the second one.
  int before = blocks.dc.empty() ? 0 : level(std::min<std::size_t>(1, blocks.dc.size() - 1));
  for (std::size_t b = 0; b < blocks.ac.size(); ++b) {
    const int now = level(b);
    ++dc[static_cast<std::size_t>(std::bit_width(static_cast<unsigned>(std::abs(now - before))))];
    before = now;
    count_magnitudes(blocks.ac[b], quantiser, ac);
  }
}

/// Of the codes, with the best table for them, and of what follows them.
double entropy_bits(const Counts& counts) {
  std::vector<std::uint8_t> symbols;
  std::vector<std::uint64_t> weights;
  for (std::size_t s = 0; s < counts.size(); ++s)
    if (counts[s] > 0) {
      symbols.push_back(static_cast<std::uint8_t>(s));
      weights.push_back(counts[s]);
    }
  if (symbols.empty()) return 0;
  const HuffmanTable table = make_huffman_table(symbols, weights);
  std::uint64_t bits = 0;
  std::size_t next = 0;
  for (std::size_t length = 1; length <= 16; ++length)
    for (unsigned n = table.bits[length]; n > 0; --n, ++next)
      bits += std::uint64_t{counts[table.symbols[next]]} * (length + (table.symbols[next] & 15u));
  return static_cast<double>(bits);
}

/// Bits of all windows at each of `sets`. count(window, counts by set) counts the symbols of one.
std::vector<double> bits_of_windows(
    std::span<const PixelWindow> windows, std::size_t sets, const RunContext& context,
    const std::function<void(const PixelWindow&, std::span<TableCounts>)>& count) {
  std::vector<TableCounts> counts(sets);
  std::mutex mutex;
  parallel_for(context, windows.size(), kWindowsPerTask, [&](std::size_t begin, std::size_t end) {
    std::vector<TableCounts> part(sets);
    for (std::size_t w = begin; w < end; ++w) count(windows[w], part);
    const std::lock_guard lock(mutex);  // sums of whole numbers: in any order
    for (std::size_t q = 0; q < part.size(); ++q) add_counts(counts[q], part[q]);
  });
  std::vector<double> out;
  for (const TableCounts& tables : counts) {
    double bits = 0;
    for (const Counts& table : tables) bits += entropy_bits(table);
    out.push_back(bits);
  }
  return out;
}

}  // namespace

MaskedRung masked_rung(const JpegKind& kind, const std::vector<std::array<std::uint16_t, 64>>& quantisers,
                       const HuffmanTables& tables) {
  MaskedRung out;
  for (std::size_t c = 0; c < kind.channels; ++c) {
    const std::size_t pair = table_pair(kind, c);
    out.push_back(block_coding(c == 0 && !kind.rgb ? BlockKind::kLuma : BlockKind::kOther, quantisers[c],
                               tables[2 * pair], tables[2 * pair + 1]));
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
    : kind_(kind), halved_(halves_chroma(kind)), components_(kind.channels) {
  for (std::size_t c = 0; c < kind.channels; ++c) pairs_.push_back(table_pair(kind, c));
}

/// A sample of halved chroma is the mean of its covered texels.
void MaskedJpeg::halve(SamplePlane& chroma) const {
  const std::uint32_t w = chroma.width;
  chroma.width /= 2, chroma.height /= 2;
  std::vector<float> values(std::size_t{chroma.width} * chroma.height);
  for (std::uint32_t y = 0; y < chroma.height; ++y) {
    for (std::uint32_t x = 0; x < chroma.width; ++x) {
      float covered = 0, all = 0, count = 0;
      for (std::uint32_t k = 0; k < 4; ++k) {
        const std::uint32_t u = 2 * x + k % 2, v = 2 * y + k / 2;
        const float weight = covered_.at(u, v), value = chroma.values[std::size_t{v} * w + u];
        covered += weight * value, count += weight, all += value;
      }
      values[std::size_t{y} * chroma.width + x] = count > 0 ? covered / count : all / 4;
    }
  }
  chroma.values = std::move(values);
}

void MaskedJpeg::load(const PixelWindow& image) {
  covered_.load(image);
  blocks_[0].load(covered_, {});
  if (halved_) blocks_[1].load(covered_, kHalved);
  for (std::size_t c = 0; c < components_.size(); ++c) {
    SamplePlane& component = components_[c];
    component.width = image.width_px, component.height = image.height_px;
    jpeg_samples(image, kind_, c, component.values);
    if (halved_ && c > 0) halve(component);
  }
}

template <class Sink>
void MaskedJpeg::code_block(std::size_t component, std::uint32_t left, std::uint32_t top,
                            std::span<const MaskedRung> rungs, std::span<Sink> sinks) {
  const bool half = halved_ && component > 0;
  const BlockValues samples = components_[component].block(left, top);
  const BlockCoverage what = blocks_[half].at(left, top);
  float level = 0, same_level = 0;
  if (what == BlockCoverage::kNothing) {
    level = mean_of(samples);
    same_level = blocks_[half].same_level_at(left, top);
  }
  BlockValues coefficients{};
  if (what == BlockCoverage::kAll) coefficients = block_dct(samples);
  if (what == BlockCoverage::kPart) {
    BlockValues weights = covered_.weights(half ? kHalved : SampleFactors{}, left, top);
    for (float& w : weights) w = std::max(w, kUncoveredWeight);
    block_.load(samples, weights);
  }
  for (std::size_t r = 0; r < rungs.size(); ++r) {
    const BlockCoding& coding = rungs[r][component];
    int& dc = dc_before_[r][component];
    const CodedBlock block = what == BlockCoverage::kAll    ? quantise_whole(coefficients, coding)
                             : what == BlockCoverage::kPart ? block_.quantise(coding, dc)
                                                            : flat_block(level, same_level, coding, dc);
    emit_block(block, dc, component, sinks[r]);
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
  for (SymbolCounts& c : counts) sinks.emplace_back(pairs_, c);
  code(image, rungs, std::span(sinks));
}

std::vector<double> jpeg_bits(const JpegKind& kind, std::span<const PixelWindow> windows,
                              std::span<const int> qualities, const RunContext& context) {
  std::vector<Quantisers> quantisers;
  for (const int quality : qualities) quantisers.push_back(quantisers_at(kind, quality));
  return bits_of_windows(
      windows, qualities.size(), context, [&](const PixelWindow& window, std::span<TableCounts> counts) {
        for (std::size_t c = 0; c < kind.channels; ++c) {
          const Blocks blocks = blocks_of(window, kind, c);
          const std::size_t table = 2 * table_pair(kind, c);
          for (std::size_t q = 0; q < quantisers.size(); ++q) {
            const auto& set = window.coverage.mask.empty() ? quantisers[q].plain : quantisers[q].masked;
            count_blocks(blocks, set[c], counts[q][table], counts[q][table + 1]);
          }
        }
      });
}

std::vector<double> requantised_bits(const JpegCoefficients& source, const SourceLayout& layout,
                                     std::span<const BlockKind> kinds, std::span<const PixelWindow> windows,
                                     std::span<const QuantiserSet> sets, const RunContext& context) {
  std::vector<std::vector<Quantiser>> quantisers(sets.size());
  for (std::size_t q = 0; q < sets.size(); ++q)
    for (std::size_t c = 0; c < layout.components.size(); ++c)
      quantisers[q].emplace_back(sets[q].steps[c],
                                 sets[q].exact ? 0.0f : bit_cost_of(kinds[c], sets[q].steps[c]));
  return bits_of_windows(windows, sets.size(), context,
                         [&](const PixelWindow& window, std::span<TableCounts> counts) {
                           for (std::size_t c = 0; c < layout.components.size(); ++c) {
                             const Blocks blocks = source_blocks(source, layout, window, c);
                             const std::size_t table = 2 * layout.pairs[c];
                             for (std::size_t q = 0; q < quantisers.size(); ++q)
                               count_blocks(blocks, quantisers[q][c], counts[q][table], counts[q][table + 1]);
                           }
                         });
}

}  // namespace texmesh
