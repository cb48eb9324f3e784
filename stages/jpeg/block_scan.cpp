#include "stages/jpeg/block_scan.h"

#include <cmath>
#include <limits>

namespace texmesh {
namespace {

constexpr int kNoCode = 1 << 28;  // bits: never
constexpr float kLargest = 1023;  // of coefficients before they are quantised
// Every change lowers the cost, so the search ends, after two or three passes; this bounds what rounding
// could do. The last ones look at the used coefficients, too. With at most 2 of those, and kMostBits = 4, a
// tenth of the time is saved and 0.5 % more bytes are taken at equal error, 2 % at qualities 75 and up.
constexpr int kMostPasses = 100, kMostTrims = 3;
// Changes that gain less, in bits, are not looked for; all of them together are 0.4 % of a rung and a third
// of the time.
constexpr float kWorthBits = 0.5f;
constexpr float kLeastGain = 1e-30f;  // where bits cost nothing
// Changes are taken in a pass that gain at least this part of the best. A half: 0.3 % fewer bytes, half as
// much time again.
constexpr float kPassPart = 0.125f;
// The least that one more coefficient is taken to cost, in bits: others are not looked at, which are most.
// 3: a tenth more time and 0.5 % more bytes at a little less error.
constexpr float kNewBits = 5;
// From the rung before: values are cut after this is added; less below 1, because the change from 0 to 1
// costs most bits. .4 and .35: 0.3 % more bytes and the same error.
constexpr float kRounding = 0.35f, kRoundingBelowOne = 0.25f;
// Then the best changes are taken to gain no more bits than this.
constexpr float kMostBits = 8;
// What making a value smaller saves at most, in bits, but for rare codes: that of 1, and others.
constexpr float kVanishingBits = 10, kSmallerBits = 3;
// Of the squared error of a block's mean, beside that of covered samples: mips that a client makes by itself
// show uncovered texels, too. On a photogrammetry site texels of 1/8 that are covered in part are 4.4 off at
// quality 97 without it, .8 with it and .5 with 1; its bytes grow by 1 % and 3 %.
constexpr float kMeanWeight = 0.15f;
// So many coefficients are taken out of the rest one by one; more go together, by transforms.
constexpr int kFewMoves = 6;

using Quad = float __attribute__((vector_size(16)));
using Bits = std::int32_t __attribute__((vector_size(16)));

Quad load_quad(const BlockValues& from, std::size_t k) {
  Quad q;
  std::memcpy(&q, from.data() + k, sizeof q);
  return q;
}
void store_quad(BlockValues& to, std::size_t k, Quad q) { std::memcpy(to.data() + k, &q, sizeof q); }
Quad magnitude(Quad q) { return (Quad)((Bits)q & 0x7fffffff); }

/// Bit k: coefficient k is one of those that a comparison of quads says.
std::uint64_t mask_where(const auto& compare) {
  Bits low{}, high{}, bit{1, 2, 4, 8};
  for (std::size_t k = 0; k < 32; k += 4, bit <<= 4) {
    low |= compare(k) & bit;
    high |= compare(k + 32) & bit;
  }
  const auto joined = [](Bits b) { return static_cast<std::uint32_t>(b[0] | b[1] | b[2] | b[3]); };
  return std::uint64_t{joined(high)} << 32 | joined(low);
}

/// x toward zero.
Quad whole_part(Quad x) { return __builtin_convertvector(__builtin_convertvector(x, Bits), Quad); }
Quad with_sign_of(Quad size, Quad x) {
  return (Quad)((Bits)size | ((Bits)x & std::numeric_limits<std::int32_t>::min()));
}

int magnitude_bits(int value) { return std::bit_width(static_cast<unsigned>(std::abs(value))); }

/// What changing one of the coefficients costs in bits.
class BitCount {
 public:
  BitCount(const BlockCoding& coding, int dc_before, CodedBlock& block)
      : coding_(coding), dc_before_(dc_before), block_(block) {}

  int value(std::size_t k) const { return block_.values[k]; }
  std::uint64_t used() const { return block_.used; }
  void set(std::size_t k, int to) {
    block_.values[k] = static_cast<std::int16_t>(to);
    const std::uint64_t bit = std::uint64_t{1} << k;
    block_.used = to != 0 ? block_.used | bit : block_.used & ~bit;
  }

  /// Bits that value `to` of coefficient k takes more than the present one.
  int more_bits(std::size_t k, int to) const {
    const int now = block_.values[k];
    if (k == 0) return dc_bits(to - dc_before_) - dc_bits(now - dc_before_);
    const std::uint64_t below = block_.used & ((std::uint64_t{1} << k) - 1) & ~std::uint64_t{1};
    const int zeros = static_cast<int>(k) - (below ? 63 - std::countl_zero(below) : 0) - 1;
    if (to != 0 && now != 0) return ac_bits(zeros, to) - ac_bits(zeros, now);
    const std::uint64_t above = k == 63 ? 0 : block_.used >> (k + 1) << (k + 1);
    const int with = ac_bits(zeros, to != 0 ? to : now);
    int more = 0;  // with it than without
    if (above == 0) {
      more = with - (k == 63 ? end_bits() : 0);
    } else {
      const int next = std::countr_zero(above), after = next - static_cast<int>(k) - 1;
      const int value = block_.values[static_cast<std::size_t>(next)];
      more = with + ac_bits(after, value) - ac_bits(zeros + 1 + after, value);
    }
    return to != 0 ? more : -more;
  }

  /// Whether every symbol has a code.
  bool can_be_coded() const {
    if (dc_bits(block_.values[0] - dc_before_) >= kNoCode) return false;
    int before = 0;
    for (std::uint64_t left = block_.used & ~std::uint64_t{1}; left != 0; left &= left - 1) {
      const int k = std::countr_zero(left);
      if (ac_bits(k - before - 1, block_.values[static_cast<std::size_t>(k)]) >= kNoCode) return false;
      before = k;
    }
    return true;
  }

 private:
  int end_bits() const { return coding_.ac.bits[0]; }
  int dc_bits(int step) const {
    const int size = magnitude_bits(step);
    const int bits = coding_.dc.bits[static_cast<std::size_t>(size)];
    return bits > 0 ? bits + size : kNoCode;
  }
  int ac_bits(int zeros, int value) const {
    const int size = magnitude_bits(value);
    const int bits = coding_.ac.bits[static_cast<std::size_t>((zeros & 15) << 4 | size)];
    return bits > 0 ? (zeros >> 4) * coding_.ac.bits[0xf0] + bits + size : kNoCode;
  }

  const BlockCoding& coding_;
  int dc_before_;
  CodedBlock& block_;
};

struct Change {
  int value = 0;
  float gain = 0;
};

/// The best of the changes of one coefficient that are worth a look.
class Look {
 public:
  /// `rest` and `energy`: the coefficient's correlation with what is left of the samples, and with itself, in
  /// quantisers.
  Look(const BlockCoding& coding, const BitCount& bits, std::size_t k, float quantiser, float rest,
       float energy)
      : coding_(coding), bits_(bits), k_(k), quantiser_(quantiser), rest_(rest), energy_(energy) {}

  Change best() {
    const int now = bits_.value(k_), move = nearest_integer(rest_ / energy_);
    if (move != 0) consider(now, move);
    if (move > 1 || move < -1) consider(now, move > 0 ? move - 1 : move + 1);
    const int smaller = now > 0 ? -1 : 1;
    if (now != 0 && smaller != move) consider(now, smaller);
    return best_;
  }

 private:
  void consider(int now, int move) {
    const auto m = static_cast<float>(move);
    const float error = m * (2 * rest_ - m * energy_);
    // One more coefficient takes bits, but for rare codes: not worth counting.
    if (now == 0 && error <= best_.gain) return;
    if (static_cast<float>(std::abs(now + move)) * quantiser_ > kLargest) return;
    const int bits = bits_.more_bits(k_, now + move);
    if (bits > kNoCode / 2) return;
    const float gain = error - coding_.bit_cost * static_cast<float>(bits);
    if (gain > best_.gain) best_ = {now + move, gain};
  }

  const BlockCoding& coding_;
  const BitCount& bits_;
  std::size_t k_;
  float quantiser_, rest_, energy_;
  Change best_;
};

/// The most that changing each coefficient can gain: of the error, and, when it is 0 so far, less `toll` for
/// its bits. 0 or less where no change gains anything.
struct Promise {
  BlockValues most;
  float peak = 0;

  Promise(const BlockValues& rest, const BlockValues& energy, const BlockValues& per_energy,
          const BlockValues& quantisers, const BlockValues& coded, float toll) {
    Quad best{}, first{0, toll, toll, toll};  // the DC has no such bits
    for (std::size_t k = 0; k < 64; k += 4) {
      const Quad r = magnitude(load_quad(rest, k));
      const Quad enough = load_quad(energy, k) * load_quad(quantisers, k) * 0.5f;
      const Quad gain = r * r * load_quad(per_energy, k);
      const Quad tolls = (Quad)((Bits)(k == 0 ? first : Quad{} + toll) & (load_quad(coded, k) == 0));
      const Quad taken = (Quad)((Bits)(gain - tolls) & (r >= enough));
      best = taken > best ? taken : best;
      store_quad(most, k, taken);
    }
    for (std::size_t k = 0; k < 4; ++k) peak = std::max(peak, best[k]);
  }

  /// Bit k: coefficient k promises at least that much.
  std::uint64_t at_least(float least) const {
    return mask_where([&](std::size_t k) { return load_quad(most, k) >= least; });
  }
};

/// Whole numbers by frequency as coefficients.
CodedBlock coded_block(const BlockValues& steps) {
  CodedBlock out;
  for (std::uint64_t left = mask_where([&](std::size_t k) { return load_quad(steps, k) != 0; }); left != 0;
       left &= left - 1) {
    const auto n = static_cast<std::size_t>(std::countr_zero(left));
    out.values[kZigzagOfNatural[n]] = static_cast<std::int16_t>(steps[n]);
    out.used |= std::uint64_t{1} << kZigzagOfNatural[n];
  }
  return out;
}

/// Bit k: coefficient k, made smaller by one quantiser, may save more bits than it costs error: one that
/// vanishes at most kVanishingBits, others kSmallerBits.
std::uint64_t worth_a_trim(const BlockValues& rest, const BlockValues& energy, const BlockCoding& coding,
                           const BlockValues& coded) {
  const Quad vanishing = Quad{} + kVanishingBits * coding.bit_cost,
             smaller = Quad{} + kSmallerBits * coding.bit_cost;
  return mask_where([&](std::size_t k) {
    const Quad c = load_quad(coded, k), q = load_quad(coding.quantisers, k);
    const Quad toward_zero =
        (Quad)((Bits)load_quad(rest, k) ^ ((Bits)c & std::numeric_limits<std::int32_t>::min()));
    const Quad cost = q * (toward_zero + toward_zero + q * load_quad(energy, k));
    return (c != 0) & (cost < (magnitude(c) < 1.5f * q ? vanishing : smaller));
  });
}

void subtract(BlockValues& from, float times, const BlockValues& column) {
  for (std::size_t k = 0; k < 64; k += 4)
    store_quad(from, k, load_quad(from, k) - times * load_quad(column, k));
}

// A bit saved may cost this many squared quantisers (mean of the first nine AC ones). Measured on three
// photogrammetry atlases: for luma .05 to .16 are within 1 % at every rung; chroma and data stand at what
// keeps their error at covered texels where plain quantisation has it, because no bytes of the figure that
// decides here, the error of luma, would show a loss.
constexpr float kLumaBitCost = 0.09f, kOtherBitCost = 0.05f;
// An uncovered block takes the DC before it when its own level is no further off: beside covered texels,
// where mips that a client makes by itself show it from 1/8 on, and elsewhere, where they do from 1/16 on. 12
// beside them: 0.7 % more bytes.
constexpr float kSameLevelBeside = 24, kSameLevel = 64;

/// The first texel that a place's triangle reaches, and one behind the last, within `count`.
std::uint32_t reach_begin(std::uint32_t place, std::uint32_t factor) {
  return place * factor - std::min(place * factor, factor / 2);
}
std::uint32_t reach_end(std::uint32_t place, std::uint32_t factor, std::uint32_t count) {
  return std::min((place + 1) * factor + factor / 2, count);
}

/// A row or column of `count` samples becomes one of count / factor; `at` gives a sample by its place.
float triangle_mean(std::uint32_t place, std::uint32_t factor, std::uint32_t count, const auto& at) {
  if (factor == 1) return at(place);
  float sum = 0;
  for (std::uint32_t d = 0; d < 2 * factor; ++d) {
    const std::int64_t from = std::int64_t{place} * factor - factor / 2 + d;
    const auto inside = static_cast<std::uint32_t>(std::clamp<std::int64_t>(from, 0, count - 1));
    sum += static_cast<float>(std::min(2 * d + 1, 4 * factor - 2 * d - 1)) * at(inside);
  }
  return sum / static_cast<float>(2 * factor * factor);
}

}  // namespace

CodedBlock quantise_whole(const BlockValues& coefficients, const BlockCoding& coding) {
  if (mask_where([&](std::size_t k) { return load_quad(coding.quantisers, k) != 1.0f; }) == 0)
    return coded_block(finest_steps(coefficients));
  BlockValues steps;
  for (std::size_t k = 0; k < 64; k += 4) {
    const Quad x = load_quad(coefficients, k) / load_quad(coding.quantisers, k);
    store_quad(steps, k, whole_part(x + with_sign_of(Quad{} + 0.5f, x)));
  }
  CodedBlock block = coded_block(steps);
  BitCount bits(coding, 0, block);
  for (std::uint64_t left = block.used & ~std::uint64_t{1}; left != 0;) {
    const auto k = static_cast<std::size_t>(63 - std::countl_zero(left));
    left &= ~(std::uint64_t{1} << k);
    const int now = block.values[k], size = std::abs(now);
    if ((size & (size - 1)) != 0) continue;  // the smaller value takes as many bits
    const int smaller = now > 0 ? now - 1 : now + 1;
    const std::size_t n = kNaturalOfZigzag[k];
    const float q = coding.quantisers[n];
    const float before = coefficients[n] - q * static_cast<float>(now);
    const float after = coefficients[n] - q * static_cast<float>(smaller);
    const float error = after * after - before * before;
    if (coding.bit_cost * static_cast<float>(bits.more_bits(k, smaller)) + error < 0) bits.set(k, smaller);
  }
  return block;
}

void MaskedBlock::load(const BlockValues& samples, const BlockValues& weights) {
  gram_.set_weights(weights, kMeanWeight);
  samples_ = samples;
  mean_ = 0;
  for (const float v : samples) mean_ += v / 8;
  BlockValues weighted;
  for (std::size_t k = 0; k < 64; ++k) weighted[k] = weights[k] * samples[k];
  rest_ = block_dct(weighted);
  rest_[0] += kMeanWeight * mean_;
  for (std::size_t k = 0; k < 64; ++k) per_energy_[k] = gram_.diagonal()[k] > 0 ? 1 / gram_.diagonal()[k] : 0;
  coded_.fill(0);
  begun_ = false;
}

/// What the rung before coded and left, in this rung's quantisers.
CodedBlock MaskedBlock::requantised(const BlockCoding& coding, int dc_before) {
  BlockValues next, steps;
  for (std::size_t k = 0; k < 64; k += 4) {
    const Quad q = load_quad(coding.quantisers, k);
    const Quad x = (load_quad(coded_, k) + load_quad(rest_, k)) / q, size = magnitude(x);
    const Quad whole = whole_part(size + (size < 1 ? Quad{} + kRoundingBelowOne : Quad{} + kRounding));
    const Quad step = with_sign_of((Quad)((Bits)whole & (whole * q <= kLargest)), x);
    store_quad(steps, k, step);
    store_quad(next, k, step * q);
  }
  CodedBlock block = coded_block(steps);
  if (!BitCount(coding, dc_before, block).can_be_coded()) {
    block = {};
    next.fill(0);
  }
  recode(next);
  return block;
}

void MaskedBlock::recode(const BlockValues& next) {
  const std::uint64_t moved =
      mask_where([&](std::size_t k) { return load_quad(next, k) != load_quad(coded_, k); });
  if (std::popcount(moved) <= kFewMoves) {
    for (std::uint64_t left = moved; left != 0; left &= left - 1) {
      const auto n = static_cast<std::size_t>(std::countr_zero(left));
      subtract(rest_, next[n] - coded_[n], gram_.column(n));
    }
  } else {
    const BlockValues shown = block_inverse_dct(next);
    BlockValues left;
    for (std::size_t k = 0; k < 64; k += 4)
      store_quad(left, k, load_quad(gram_.weights(), k) * (load_quad(samples_, k) - load_quad(shown, k)));
    rest_ = block_dct(left);
    rest_[0] += kMeanWeight * (mean_ - next[0]);
  }
  coded_ = next;
}

CodedBlock MaskedBlock::quantise(const BlockCoding& coding, int dc_before) {
  CodedBlock block;
  BitCount bits(coding, dc_before, block);
  const float worth = kWorthBits * coding.bit_cost;
  float least = std::numeric_limits<float>::max();
  if (begun_) {
    block = requantised(coding, dc_before);
    least = kMostBits * coding.bit_cost;
  }
  begun_ = true;
  const BlockValues& energy = gram_.diagonal();
  // Most looks at a used coefficient find nothing: they are left for the end.
  for (int pass = 0, trims = 0; pass < kMostPasses && trims < kMostTrims; ++pass) {
    const Promise promise(rest_, energy, per_energy_, coding.quantisers, coded_, kNewBits * coding.bit_cost);
    least = std::max(std::min(promise.peak, least) * kPassPart, worth);
    const bool trim = least == worth;
    std::uint64_t left = promise.peak >= least ? promise.at_least(std::max(least, kLeastGain)) : 0;
    if (trim && block.used != 0) left |= worth_a_trim(rest_, energy, coding, coded_);
    if (left == 0 && trim) break;
    bool changed = false;
    for (; left != 0; left &= left - 1) {
      const auto n = static_cast<std::size_t>(std::countr_zero(left));
      if (per_energy_[n] == 0) continue;
      const std::size_t k = kZigzagOfNatural[n];
      const float q = coding.quantisers[n];
      const Change change = Look(coding, bits, k, q, rest_[n] * q, energy[n] * q * q).best();
      if (change.gain < least || change.gain <= 0) continue;
      const float moved = static_cast<float>(change.value - bits.value(k)) * q;
      subtract(rest_, moved, gram_.column(n));
      coded_[n] += moved;
      bits.set(k, change.value);
      changed = true;
    }
    trims += trim;
    if (trim && !changed) break;
  }
  return block;
}

float bit_cost_of(BlockKind kind, const std::array<std::uint16_t, 64>& quantisers) {
  float square = 0;
  for (std::size_t k = 1; k < 10; ++k) {
    const float q = quantisers[k];
    square += q * q / 9;
  }
  return (kind == BlockKind::kLuma ? kLumaBitCost : kOtherBitCost) * square;
}

BlockCoding block_coding(BlockKind kind, const std::array<std::uint16_t, 64>& quantisers,
                         const HuffmanTable& dc, const HuffmanTable& ac) {
  BlockCoding coding;
  for (std::size_t k = 0; k < 64; ++k) coding.quantisers[kNaturalOfZigzag[k]] = quantisers[k];
  coding.bit_cost = bit_cost_of(kind, quantisers);
  coding.dc = symbol_codes(dc);
  coding.ac = symbol_codes(ac);
  return coding;
}

float mean_of(const BlockValues& samples) {
  std::array<float, 8> sums{};
  for (std::size_t k = 0; k < 64; ++k) sums[k % 8] += samples[k];
  float sum = 0;
  for (const float s : sums) sum += s;
  return sum / 64;
}

BlockValues SamplePlane::block(std::uint32_t left, std::uint32_t top) const {
  BlockValues out;
  for (std::uint32_t y = 0; y < 8; ++y)
    std::memcpy(out.data() + 8 * y, values.data() + std::size_t{top + y} * width + left, 8 * sizeof(float));
  return out;
}

void CoveredTexels::load(const PixelWindow& window) {
  width_px_ = window.width_px, height_px_ = window.height_px;
  const CoverageMask& mask = window.coverage.mask;
  bits_.assign(std::size_t{height_px_} * (width_px_ / 8), mask.empty() ? 0xff : 0);
  if (mask.empty()) return;
  std::uint8_t* to = bits_.data();
  for (std::uint32_t y = 0; y < height_px_; ++y)
    for (std::uint32_t x = 0; x < width_px_; x += 8, ++to) {
      const std::uint32_t u = window.coverage.left_px + x, v = window.coverage.top_px + y;
      if (u % 8 == 0 && u + 8 <= mask.width_px && v < mask.height_px)
        *to = mask.byte_at(u, v);
      else
        for (std::uint32_t k = 0; k < 8; ++k)
          *to = static_cast<std::uint8_t>(*to << 1 | (window.coverage.covered(x + k, y) ? 1 : 0));
    }
}

BlockValues CoveredTexels::texels(std::uint32_t left, std::uint32_t top) const {
  BlockValues out;
  for (std::uint32_t y = 0; y < 8; ++y) {
    const unsigned row = bits_[std::size_t{top + y} * (width_px_ / 8) + left / 8];
    for (std::uint32_t x = 0; x < 8; ++x) out[8 * y + x] = static_cast<float>(row >> (7 - x) & 1);
  }
  return out;
}

BlockValues CoveredTexels::weights(SampleFactors factors, std::uint32_t left, std::uint32_t top) const {
  if (factors.across == 1 && factors.down == 1) return texels(left, top);
  constexpr std::uint32_t kMostRows = 8 * 4 + 4;
  const std::uint32_t first = reach_begin(top, factors.down);
  const std::uint32_t end = reach_end(top + 7, factors.down, height_px_);
  std::array<std::array<float, 8>, kMostRows> rows;
  for (std::uint32_t y = first; y < end; ++y)
    for (std::uint32_t x = 0; x < 8; ++x)
      rows[y - first][x] =
          triangle_mean(left + x, factors.across, width_px_, [&](std::uint32_t k) { return at(k, y); });
  BlockValues out;
  for (std::uint32_t y = 0; y < 8; ++y)
    for (std::uint32_t x = 0; x < 8; ++x)
      out[8 * y + x] = triangle_mean(top + y, factors.down, height_px_,
                                     [&](std::uint32_t k) { return rows[k - first][x]; });
  return out;
}

BlockCoverage CoveredTexels::block(SampleFactors factors, std::uint32_t left, std::uint32_t top) const {
  const std::uint32_t begin = reach_begin(left, factors.across);
  const std::uint32_t last = reach_end(left + 7, factors.across, width_px_) - 1;
  bool all = true, any = false;
  for (std::uint32_t y = reach_begin(top, factors.down); y < reach_end(top + 7, factors.down, height_px_);
       ++y)
    for (std::uint32_t k = begin / 8; k <= last / 8; ++k) {
      unsigned mask = 0xff;
      if (k == begin / 8) mask &= 0xffu >> begin % 8;
      if (k == last / 8) mask &= 0xffu << (7 - last % 8);
      const unsigned set = bits_[std::size_t{y} * (width_px_ / 8) + k] & mask;
      all &= set == mask, any |= set != 0;
    }
  return all ? BlockCoverage::kAll : any ? BlockCoverage::kPart : BlockCoverage::kNothing;
}

void CoveredBlocks::load(const CoveredTexels& texels, SampleFactors factors) {
  columns_ = texels.width_px() / (8 * factors.across), rows_ = texels.height_px() / (8 * factors.down);
  blocks_.clear();
  for (std::uint32_t row = 0; row < rows_; ++row)
    for (std::uint32_t column = 0; column < columns_; ++column)
      blocks_.push_back(texels.block(factors, 8 * column, 8 * row));
}

float CoveredBlocks::same_level_at(std::uint32_t left, std::uint32_t top) const {
  const std::uint32_t column = left / 8, row = top / 8;
  for (std::uint32_t v = row > 0 ? row - 1 : 0; v < std::min(row + 2, rows_); ++v)
    for (std::uint32_t u = column > 0 ? column - 1 : 0; u < std::min(column + 2, columns_); ++u)
      if (blocks_[std::size_t{v} * columns_ + u] != BlockCoverage::kNothing) return kSameLevelBeside;
  return kSameLevel;
}

CodedBlock flat_block(float level, float same_level, const BlockCoding& coding, int dc_before) {
  CodedBlock out;
  const float own = 8 * level / coding.quantisers[0];
  const int nearest = static_cast<int>(own < 0 ? own - 0.5f : own + 0.5f);
  const float off = static_cast<float>(nearest - dc_before) * coding.quantisers[0] / 8;
  out.values[0] = static_cast<std::int16_t>(std::fabs(off) <= same_level ? dc_before : nearest);
  return out;
}

}  // namespace texmesh
