#pragma once
// Inside stages only: how far a decoded fragment is from its source, over covered texels.
#include <cstddef>
#include <cstdint>
#include <vector>

namespace texmesh {

struct Distortion {
  double mse = 0;    // of 8-bit values
  double dssim = 0;  // 1 - SSIM, 0 = equal
};

/// One fragment's source, against which any number of decoded versions is compared.
class DistortionMeter {
 public:
  /// `source` and `mask` are width x height values, sides multiples of 4 and at least 8; a mask is 0 or 255.
  /// At least one texel is covered.
  DistortionMeter(std::vector<std::uint8_t> source, std::vector<std::uint8_t> mask, std::uint32_t width,
                  std::uint32_t height);

  /// MSE and the mean structural similarity (Wang et al. 2004) in 8 x 8 windows every 4 texels, without
  /// Gaussian weights. Statistics of a window are those of its covered texels, and it counts as many times as
  /// it has of them.
  Distortion against(const std::vector<std::uint8_t>& decoded) const;

 private:
  /// Sums over the covered texels of one 4 x 4 cell.
  struct SourceCell {
    std::uint32_t count, sum, square;
  };
  struct DecodedCell {
    std::uint32_t sum, square, product;
  };
  void sum_cells(const std::vector<std::uint8_t>& decoded, std::uint32_t row, std::vector<DecodedCell>& out,
                 std::vector<std::uint32_t>& sums) const;

  std::vector<std::uint8_t> source_, mask_;  // source_ is 0 where the mask is
  std::uint32_t width_, columns_, rows_;     // in cells
  std::vector<SourceCell> cells_;
};

}  // namespace texmesh
