#include "stages/jpeg/block_transform.h"

#include <cmath>
#include <cstring>

#include "format/base/portable_math.h"

namespace texmesh {
namespace {

using Quad = float __attribute__((vector_size(16)));  // what SSE2 has: no wider, so that bits never differ

Quad load(const float* from) {
  Quad q;
  std::memcpy(&q, from, sizeof q);
  return q;
}
void store(float* to, Quad q) { std::memcpy(to, &q, sizeof q); }

float scale_of(std::size_t k) { return k == 0 ? 0.35355339f : 0.5f; }

/// [frequency * 8 + sample], and [sample * 24 + 7 + frequency] for frequencies -7 to 16: without scale.
struct Cosines {
  std::array<float, 15 * 8> of_frequency{};
  std::array<float, 8 * 24> of_sample{};
  std::array<float, 64> matrix{},
      transposed{};      // the DCT: [frequency * 8 + sample], [sample * 8 + frequency]
  BlockValues scales{};  // [8 * down + across]: of both, half each time

  Cosines() {
    const auto cosine = [](int n, int k) {
      return static_cast<float>(portable::cos((2 * n + 1) * k * portable::kPi / 16));
    };
    for (int n = 0; n < 8; ++n) {
      const auto at = static_cast<std::size_t>(n);
      for (std::size_t k = 0; k < 15; ++k) of_frequency[k * 8 + at] = cosine(n, static_cast<int>(k));
      for (std::size_t k = 0; k < 24; ++k)
        of_sample[at * 24 + k] = cosine(n, k < 7 ? 7 - static_cast<int>(k) : static_cast<int>(k) - 7);
      for (std::size_t k = 0; k < 8; ++k)
        matrix[k * 8 + at] = transposed[at * 8 + k] = scale_of(k) * of_frequency[k * 8 + at];
    }
    for (std::size_t k = 0; k < 64; ++k) scales[k] = scale_of(k / 8) * scale_of(k % 8) / 2;
  }
};
const Cosines kCosines;

/// out = left right, 8 x 8 each.
void multiply(const float* left, const float* right, float* out) {
  for (std::size_t i = 0; i < 8; ++i) {
    Quad a{}, b{};
    for (std::size_t k = 0; k < 8; ++k) {
      a += left[i * 8 + k] * load(right + k * 8);
      b += left[i * 8 + k] * load(right + k * 8 + 4);
    }
    store(out + i * 8, a);
    store(out + i * 8 + 4, b);
  }
}

constexpr float kBorne = 0.3f;        // errors below are not made smaller; .2 and .36 leave more samples off
constexpr int kTriedSteps = 3;        // 1: 6.5 % of the samples are off; 8: 6.0 %
constexpr int kMostSteps = 16;        // three are usual
constexpr float kLargestStep = 1000;  // of coefficients that are changed

using QuadBits = std::int32_t __attribute__((vector_size(16)));

/// What errors have above kBorne, without sign.
Quad excess(Quad error) {
  const Quad size = (Quad)((QuadBits)error & 0x7fffffff) - kBorne;
  return (Quad)((QuadBits)size & (size > 0));
}

float sum_of(Quad v) { return (v[0] + v[1]) + (v[2] + v[3]); }

/// Basis functions of the inverse transform.
const std::array<BlockValues, 64>& basis_functions() {
  static const auto functions = [] {
    std::array<BlockValues, 64> out;
    for (std::size_t k = 0; k < 64; ++k) {
      BlockValues one{};
      one[k] = 1;
      out[k] = block_inverse_dct(one);
    }
    return out;
  }();
  return functions;
}

/// Sum of squares of the excess of error + step x function.
float cost_with(const BlockValues& error, float step, const BlockValues& function) {
  Quad sum{};
  for (std::size_t k = 0; k < 64; k += 4) {
    const Quad over = excess(load(error.data() + k) + step * load(function.data() + k));
    sum += over * over;
  }
  return sum_of(sum);
}

/// Half of the cost's derivatives by the coefficients.
BlockValues cost_slopes(const BlockValues& error) {
  BlockValues over;
  for (std::size_t k = 0; k < 64; ++k) {
    const float size = std::fabs(error[k]) - kBorne;
    over[k] = size <= 0 ? 0 : error[k] < 0 ? -size : size;
  }
  return block_dct(over);
}

std::size_t steepest(const BlockValues& slopes) {
  std::size_t best = 0;
  for (std::size_t k = 1; k < 64; ++k)
    if (std::fabs(slopes[k]) > std::fabs(slopes[best])) best = k;
  return best;
}

/// Takes one step that lowers the cost; false when none of those that are tried does.
bool take_step(BlockValues& steps, BlockValues& error, float& cost) {
  BlockValues slopes = cost_slopes(error);
  for (int tried = 0; tried < kTriedSteps; ++tried) {
    const std::size_t k = steepest(slopes);
    if (slopes[k] == 0) return false;
    const float step = slopes[k] > 0 ? -1.0f : 1.0f;
    slopes[k] = 0;
    if (std::fabs(steps[k] + step) > kLargestStep) continue;
    const BlockValues& function = basis_functions()[k];
    const float then = cost_with(error, step, function);
    if (then >= cost) continue;
    cost = then;
    steps[k] += step;
    for (std::size_t s = 0; s < 64; ++s) error[s] += step * function[s];
    return true;
  }
  return false;
}

}  // namespace

BlockValues block_dct(const BlockValues& samples) {
  BlockValues columns, out;
  multiply(kCosines.matrix.data(), samples.data(), columns.data());
  multiply(columns.data(), kCosines.transposed.data(), out.data());
  return out;
}

BlockValues block_inverse_dct(const BlockValues& coefficients) {
  BlockValues columns, out;
  multiply(kCosines.transposed.data(), coefficients.data(), columns.data());
  multiply(columns.data(), kCosines.matrix.data(), out.data());
  return out;
}

BlockValues finest_steps(const BlockValues& coefficients) {
  BlockValues steps, rest;
  for (std::size_t k = 0; k < 64; ++k) {
    steps[k] = static_cast<float>(nearest_integer(coefficients[k]));
    rest[k] = steps[k] - coefficients[k];
  }
  BlockValues error = block_inverse_dct(rest);
  float cost = cost_with(error, 0, basis_functions()[0]);
  for (int step = 0; step < kMostSteps && cost > 0; ++step)
    if (!take_step(steps, error, cost)) break;
  return steps;
}

void BlockGram::set_weights(const BlockValues& weights, float mean_weight) {
  if (weights == weights_ && mean_weight == mean_weight_) return;
  weights_ = weights;
  mean_weight_ = mean_weight;
  has_column_ = 0;
  for (std::size_t t = 0; t < kFrequencies; ++t) {
    Quad down[2]{}, sum[kStride / 4]{};
    for (std::size_t y = 0; y < 8; ++y)
      for (std::size_t h = 0; h < 2; ++h)
        down[h] += kCosines.of_frequency[t * 8 + y] * load(weights.data() + y * 8 + 4 * h);
    for (std::size_t x = 0; x < 8; ++x)
      for (std::size_t q = 0; q < kStride / 4; ++q)
        sum[q] += down[x / 4][x % 4] * load(kCosines.of_sample.data() + x * kStride + 4 * q);
    for (std::size_t q = 0; q < kStride / 4; ++q) store(spectrum_.data() + t * kStride + 4 * q, sum[q]);
  }
  const float* none = spectrum_.data() + 7;
  for (std::size_t k = 0; k < 64; ++k) {
    const std::size_t u = k % 8, v = k / 8;
    const float *twice = none + 2 * v * kStride, a = kCosines.scales[k];
    diagonal_[k] = a * a * (none[0] + none[2 * u] + twice[0] + twice[2 * u]);  // cos^2 x = (1 + cos 2 x) / 2
  }
  diagonal_[0] += mean_weight;
}

/// cos a cos b = (cos(a - b) + cos(a + b)) / 2, along both axes.
void BlockGram::make_column(std::size_t k) {
  has_column_ |= std::uint64_t{1} << k;
  const std::size_t u = k % 8, v = k / 8;
  for (std::size_t t = 0; t < 8; ++t) {
    const float* low = spectrum_.data() + (v > t ? v - t : t - v) * kStride + 7;
    const float* high = spectrum_.data() + (v + t) * kStride + 7;
    for (std::size_t s = 0; s < 8; s += 4) {
      const Quad sum = load(low + s - u) + load(low + s + u) + load(high + s - u) + load(high + s + u);
      store(columns_[k].data() + t * 8 + s,
            kCosines.scales[k] * load(kCosines.scales.data() + t * 8 + s) * sum);
    }
  }
  if (k == 0) columns_[0][0] += mean_weight_;
}

}  // namespace texmesh
