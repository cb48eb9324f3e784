#pragma once
// Inside stages only: JPEG's transform of 8 x 8 blocks, and what a mask makes of it. Plain single precision
// in a fixed order: same bits everywhere.
#include <array>
#include <cstdint>

namespace texmesh {

/// Samples, or coefficients by frequency: [8 * down + across].
using BlockValues = std::array<float, 64>;

/// The integer nearest to a coefficient; halves go away from 0.
inline int nearest_integer(float x) { return static_cast<int>(x < 0 ? x - 0.5f : x + 0.5f); }

/// Orthonormal DCT, which is JPEG's.
BlockValues block_dct(const BlockValues& samples);
BlockValues block_inverse_dct(const BlockValues& coefficients);

/// Whole numbers by frequency, quantisers of 1, for the DCT of a block of whole samples. The nearest whole
/// numbers leave 8.3 % of the samples more than half a step off, so that they decode to a neighbour. From
/// there on steps of one coefficient follow that lower the squares of what errors have above 0.3: 6.1 % are
/// off then. The gradient of these squares says which steps are tried. Looking at all 64 coefficients in each
/// step leaves 5.8 % and takes ten times as long. AC coefficients stay within the 10 bits of baseline JPEG.
BlockValues finest_steps(const BlockValues& coefficients);

/// Products of the transform's basis functions with each other, summed over samples by weight.
class BlockGram {
 public:
  /// Weights 0..1, not all 0; `mean_weight` is added to the product of basis function 0 with itself. Costs
  /// little when they are the last ones.
  void set_weights(const BlockValues& weights, float mean_weight);
  const BlockValues& weights() const { return weights_; }
  /// Of every basis function with itself.
  const BlockValues& diagonal() const { return diagonal_; }
  /// Of basis function k with all of them.
  const BlockValues& column(std::size_t k) {
    if (!(has_column_ >> k & 1)) make_column(k);
    return columns_[k];
  }

 private:
  static constexpr std::size_t kFrequencies = 15;  // 0..14: sums of two of 0..7
  static constexpr std::size_t kStride = 24;       // frequencies -7..14 across, and two more

  void make_column(std::size_t k);

  BlockValues weights_{};
  float mean_weight_ = 0;
  std::array<float, kFrequencies * kStride> spectrum_{};  // of the weights: sums of w cos() cos()
  BlockValues diagonal_{};
  std::array<BlockValues, 64> columns_;
  std::uint64_t has_column_ = 0;
};

}  // namespace texmesh
