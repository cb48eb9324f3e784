#include "stages/jpeg/finest_block.h"

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace texmesh {
namespace {

constexpr float kBorne = 0.3f;        // errors below are not made smaller; .2 and .36 leave more samples off
constexpr int kTriedSteps = 3;        // 1: 6.5 % of the samples are off; 8: 6.0 %
constexpr int kMostSteps = 16;        // three are usual
constexpr float kLargestStep = 1000;  // of coefficients that are changed

using FourValues = float __attribute__((vector_size(16)));
using FourMasks = std::int32_t __attribute__((vector_size(16)));

FourValues four_of(const BlockValues& from, std::size_t k) {
  FourValues out;
  std::memcpy(&out, from.data() + k, sizeof out);
  return out;
}

/// What errors have above kBorne, without sign.
FourValues excess(FourValues error) {
  const FourValues size = (FourValues)((FourMasks)error & 0x7fffffff) - kBorne;
  return (FourValues)((FourMasks)size & (size > 0));
}

float sum_of(FourValues v) { return (v[0] + v[1]) + (v[2] + v[3]); }

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
  FourValues sum{};
  for (std::size_t k = 0; k < 64; k += 4) {
    const FourValues over = excess(four_of(error, k) + step * four_of(function, k));
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

}  // namespace texmesh
