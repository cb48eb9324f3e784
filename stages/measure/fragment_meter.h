#pragma once
// Inside stages only: how far a decoded fragment, or a preview scaled up as clients do it, is from its
// source, over covered texels.

#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"

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

/// Values of 8 bits by channel, then texel.
using Samples = std::vector<std::vector<std::uint8_t>>;

/// 1: luma of colours, as JPEG defines it, or the grey of a single channel. Else all of them: no channel of
/// data stands for another.
std::size_t measured_channels(const TexturePlane& plane);

/// Channel `c` of `measured` of a texel with `channels`.
inline std::uint8_t measured_value(const std::uint8_t* texel, std::uint32_t channels, std::size_t measured,
                                   std::size_t c) {
  if (channels == 1 || measured > 1) return texel[c];
  return static_cast<std::uint8_t>((19595 * texel[0] + 38470 * texel[1] + 7471 * texel[2] + 32768) >> 16);
}

/// The measured channels of a rectangle of the plane's padded pixels.
Samples rectangle_samples(const TexturePlane& plane, const Pixels& pixels, const TexelRectangle& rectangle);

/// 255 for the rectangle's covered texels, 0 for the others and for texels beyond the plane.
std::vector<std::uint8_t> coverage_samples(const TexturePlane& plane, const TexelRectangle& rectangle);

/// The measured channels of pixels that have as many, or 1 or 3.
Samples split_samples(const Pixels& pixels, std::size_t measured);

/// A fragment's as a rung shows them. FormatError as decode_fragment.
Samples decode_samples(const PlaneLadder& ladder, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels, std::size_t measured);

/// DistortionMeter for every channel: MSE is the mean of them; 1 - SSIM that of those which vary in covered
/// texels, because a constant one is kept by any rung and would hide what the others lose.
class FragmentMeter {
 public:
  FragmentMeter(Samples source, const std::vector<std::uint8_t>& mask, std::uint32_t width,
                std::uint32_t height);
  Distortion against(const Samples& shown) const;

 private:
  std::vector<DistortionMeter> meters_;
  std::vector<double> weights_;  // of 1 - SSIM
};

/// Where a texel lies between two texels of a coarser image, along one axis.
struct BilinearPlace {
  std::uint32_t first, second, part;  // `part` of 256 of the way from first to second
};

/// The places of `count` texels from `first` on. The axis has `size` texels, the coarser image's
/// `coarse_size`. Texels beyond the axis lie where its last texel does.
std::vector<BilinearPlace> bilinear_places(std::uint32_t first, std::uint32_t count, std::uint32_t size,
                                           std::uint32_t coarse_size);

/// The samples of a rectangle of an image.
struct SamplePatch {
  TexelRectangle rectangle;
  Samples samples;
};

/// Samples of across.size() x down.size() texels, bilinear between those of `patch`, which holds every texel
/// that the places name.
Samples scaled_up(const SamplePatch& patch, const std::vector<BilinearPlace>& across,
                  const std::vector<BilinearPlace>& down);

/// What the plane's distortion is measured on, of its whole preview. `file` is a complete JPEG; FormatError
/// when it is damaged or has more than 2^26 pixels.
SamplePatch preview_samples(const TexturePlane& plane, const std::vector<std::uint8_t>& file);

/// A rectangle of the plane as its preview shows it.
Samples show_preview(const TexturePlane& plane, const SamplePatch& preview, const TexelRectangle& rectangle);

}  // namespace texmesh
