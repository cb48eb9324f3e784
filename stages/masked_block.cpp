#include "stages/masked_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdlib>
#include <limits>

#include "format/portable_math.h"
#include "stages/jpeg_stream.h"

namespace texmesh {
namespace {

constexpr std::size_t kFrequencies = 15;  // 0..14: sums of two of 0..7
constexpr int kNoCode = 1 << 28;          // bits: never
constexpr float kLargest = 1023;          // of coefficients before they are quantised
// Every change lowers the cost, so the search ends, after about six passes; this bounds what rounding could
// do. The last ones look at the used coefficients, too.
constexpr int kMostPasses = 100, kMostTrims = 3;
// Changes that gain less, in bits, are not looked for; all of them together are 0.4 % of a rung and a third
// of the time.
constexpr float kWorthBits = 0.5f;
// Changes are taken in a pass that gain at least this part of the best. A half: 0.3 % fewer bytes, half as
// much time again.
constexpr float kPassPart = 0.125f;

/// [frequency * 8 + sample]: cos((2 n + 1) k pi / 16).
const std::array<float, kFrequencies * 8>& cosines() {
  static const auto table = [] {
    std::array<float, kFrequencies * 8> t{};
    for (std::size_t k = 0; k < kFrequencies; ++k)
      for (std::size_t n = 0; n < 8; ++n)
        t[k * 8 + n] =
            static_cast<float>(portable::cos(static_cast<double>((2 * n + 1) * k) * portable::kPi / 16));
    return t;
  }();
  return table;
}

float scale_of(std::size_t k) { return k == 0 ? 0.35355339f : 0.5f; }

int bits_of(int value) { return std::bit_width(static_cast<unsigned>(std::abs(value))); }

int nearest(float x) { return static_cast<int>(x < 0 ? x - 0.5f : x + 0.5f); }

/// out[t * 8 + x] = sum over y of cos(t, y) in[y * 8 + x].
template <std::size_t kCount>
void transform_columns(const BlockValues& in, std::array<float, kCount * 8>& out) {
  const auto& c = cosines();
  out.fill(0);
  for (std::size_t t = 0; t < kCount; ++t)
    for (std::size_t y = 0; y < 8; ++y)
      for (std::size_t x = 0; x < 8; ++x) out[t * 8 + x] += c[t * 8 + y] * in[y * 8 + x];
}

float dot_with_cosine(const float* row, std::size_t k) {
  const float* c = cosines().data() + k * 8;
  float sum = 0;
  for (std::size_t x = 0; x < 8; ++x) sum += row[x] * c[x];
  return sum;
}

/// The coefficients in hand, and what changing one of them costs in bits.
class CodedBlock {
 public:
  CodedBlock(const BlockCoding& coding, int dc_before) : coding_(coding), dc_before_(dc_before) {}

  int value(std::size_t k) const { return values_[k]; }
  std::uint64_t used() const { return used_; }
  const BlockCoefficients& values() const { return values_; }
  void set(std::size_t k, int to) {
    values_[k] = static_cast<std::int16_t>(to);
    const std::uint64_t bit = std::uint64_t{1} << k;
    used_ = to != 0 ? used_ | bit : used_ & ~bit;
  }

  /// Bits that value `to` of coefficient k takes more than the present one.
  int more_bits(std::size_t k, int to) const {
    if (k == 0) return dc_bits(to - dc_before_) - dc_bits(values_[0] - dc_before_);
    const std::uint64_t below = used_ & ((std::uint64_t{1} << k) - 1) & ~std::uint64_t{1};
    const std::uint64_t above = k == 63 ? 0 : used_ >> (k + 1) << (k + 1);
    const int before = below ? 63 - std::countl_zero(below) : 0, at = static_cast<int>(k);
    return span_bits(before, at, to, above) - span_bits(before, at, values_[k], above);
  }

 private:
  int dc_bits(int step) const {
    const int size = bits_of(step);
    const int bits = coding_.dc.bits[static_cast<std::size_t>(size)];
    return bits > 0 ? bits + size : kNoCode;
  }
  int ac_bits(int zeros, int value) const {
    const int size = bits_of(value);
    const int bits = coding_.ac.bits[static_cast<std::size_t>((zeros & 15) << 4 | size)];
    return bits > 0 ? (zeros >> 4) * coding_.ac.bits[0xf0] + bits + size : kNoCode;
  }
  /// From the used coefficient `before` to the next one above k, or to the end of the block.
  int span_bits(int before, int k, int value, std::uint64_t above) const {
    int bits = 0, last = before;
    if (value != 0) {
      bits = ac_bits(k - before - 1, value);
      last = k;
    }
    if (above == 0) return bits + (last == 63 ? 0 : coding_.ac.bits[0]);
    const int next = std::countr_zero(above);
    return bits + ac_bits(next - last - 1, values_[static_cast<std::size_t>(next)]);
  }

  const BlockCoding& coding_;
  int dc_before_;
  BlockCoefficients values_{};
  std::uint64_t used_ = 0;
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
  Look(const BlockCoding& coding, const CodedBlock& block, std::size_t k, float rest, float energy)
      : coding_(coding), block_(block), k_(k), rest_(rest), energy_(energy) {}

  Change best() {
    const int now = block_.value(k_), move = nearest(rest_ / energy_);
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
    if (static_cast<float>(std::abs(now + move)) * coding_.quantisers[k_] > kLargest) return;
    const int bits = block_.more_bits(k_, now + move);
    if (bits > kNoCode / 2) return;
    const float gain = error - coding_.bit_cost * static_cast<float>(bits);
    if (gain > best_.gain) best_ = {now + move, gain};
  }

  const BlockCoding& coding_;
  const CodedBlock& block_;
  std::size_t k_;
  float rest_, energy_;
  Change best_;
};

}  // namespace

BlockValues block_dct(const BlockValues& samples) {
  BlockValues columns, out;
  transform_columns<8>(samples, columns);
  for (std::size_t k = 0; k < 64; ++k) {
    const std::size_t u = kNaturalOfZigzag[k] % 8, v = kNaturalOfZigzag[k] / 8;
    out[k] = dot_with_cosine(columns.data() + v * 8, u) * scale_of(u) * scale_of(v);
  }
  return out;
}

BlockCoefficients quantise_whole(const BlockValues& coefficients, const BlockCoding& coding) {
  CodedBlock block(coding, 0);
  for (std::size_t k = 0; k < 64; ++k) block.set(k, nearest(coefficients[k] / coding.quantisers[k]));
  for (std::uint64_t left = block.used() & ~std::uint64_t{1}; left != 0;) {
    const auto k = static_cast<std::size_t>(63 - std::countl_zero(left));
    left &= ~(std::uint64_t{1} << k);
    const int now = block.value(k), smaller = now > 0 ? now - 1 : now + 1;
    const float q = coding.quantisers[k];
    const float before = coefficients[k] - q * static_cast<float>(now);
    const float after = coefficients[k] - q * static_cast<float>(smaller);
    const float error = after * after - before * before;
    if (coding.bit_cost * static_cast<float>(block.more_bits(k, smaller)) + error < 0) block.set(k, smaller);
  }
  return block.values();
}

void MaskedBlock::load(const BlockValues& samples, const BlockValues& weights) {
  BlockValues weighted;
  for (std::size_t k = 0; k < 64; ++k) weighted[k] = weights[k] * samples[k];
  correlation_ = block_dct(weighted);
  std::array<float, kFrequencies * 8> columns;
  transform_columns<kFrequencies>(weights, columns);
  for (std::size_t t = 0; t < kFrequencies; ++t)
    for (std::size_t s = 0; s < kFrequencies; ++s)
      spectrum_[t * kFrequencies + s] = dot_with_cosine(columns.data() + t * 8, s);
  has_column_ = 0;
  for (std::size_t k = 0; k < 64; ++k) {
    const std::size_t u = kNaturalOfZigzag[k] % 8, v = kNaturalOfZigzag[k] / 8;
    const float a = scale_of(u) * scale_of(v) * 0.5f;  // cos^2 x = (1 + cos 2 x) / 2
    diagonal_[k] = a * a *
                   (spectrum_[0] + spectrum_[2 * u] + spectrum_[2 * v * kFrequencies] +
                    spectrum_[2 * v * kFrequencies + 2 * u]);
  }
}

/// cos a cos b = (cos(a - b) + cos(a + b)) / 2, along both axes.
const BlockValues& MaskedBlock::gram_column(std::size_t k) {
  BlockValues& column = gram_[k];
  if (has_column_ >> k & 1) return column;
  has_column_ |= std::uint64_t{1} << k;
  const std::size_t u = kNaturalOfZigzag[k] % 8, v = kNaturalOfZigzag[k] / 8;
  const float a = scale_of(u) * scale_of(v) * 0.25f;
  for (std::size_t j = 0; j < 64; ++j) {
    const std::size_t s = kNaturalOfZigzag[j] % 8, t = kNaturalOfZigzag[j] / 8;
    const float* low = spectrum_.data() + (v > t ? v - t : t - v) * kFrequencies;
    const float* high = spectrum_.data() + (v + t) * kFrequencies;
    const std::size_t d = u > s ? u - s : s - u, e = u + s;
    column[j] = a * scale_of(s) * scale_of(t) * (low[d] + low[e] + high[d] + high[e]);
  }
  return column;
}

BlockCoefficients MaskedBlock::quantise(const BlockCoding& coding, int dc_before) {
  CodedBlock block(coding, dc_before);
  // In units of quantisers: a coefficient's correlation with what is left, and with itself.
  BlockValues rest, energy;
  for (std::size_t k = 0; k < 64; ++k) {
    const float q = coding.quantisers[k];
    rest[k] = correlation_[k] * q;
    energy[k] = diagonal_[k] * q * q;
  }
  const float worth = kWorthBits * coding.bit_cost;
  float least = std::numeric_limits<float>::max();
  // Most looks at a used coefficient find nothing: they are left for the end.
  for (int pass = 0, trims = 0; pass < kMostPasses && trims < kMostTrims;) {
    const bool trim = least == worth;
    float refused = 0;
    bool changed = false;
    for (std::size_t k = 0; k < 64; ++k) {
      if (energy[k] <= 0) continue;
      if (!(trim && block.value(k) != 0)) {
        if (std::fabs(rest[k]) * 2 < energy[k]) continue;
        // No change of the coefficient takes more error away, whatever bits it costs.
        if (const float most = rest[k] * rest[k]; most < least * energy[k]) {
          refused = std::max(refused, most / energy[k]);
          continue;
        }
      }
      const Change change = Look(coding, block, k, rest[k], energy[k]).best();
      if (change.gain < least || change.gain <= 0) {
        refused = std::max(refused, change.gain);
        continue;
      }
      const float moved = static_cast<float>(change.value - block.value(k)) * coding.quantisers[k];
      const BlockValues& column = gram_column(k);
      for (std::size_t j = 0; j < 64; ++j) rest[j] -= moved * column[j] * coding.quantisers[j];
      block.set(k, change.value);
      changed = true;
    }
    ++pass;
    trims += trim;
    if (trim && !changed) break;
    least = std::max(std::min(refused, least) * kPassPart, worth);
  }
  return block.values();
}

}  // namespace texmesh
