#pragma once
// Inside stages only: what the distortion of a fragment is measured on.
#include <cstdint>
#include <vector>

#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/measure/distortion.h"

namespace texmesh {

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

}  // namespace texmesh
