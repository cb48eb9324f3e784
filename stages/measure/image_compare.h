#pragma once

#include "stages/measure/picture.h"

namespace texmesh {

/// What SSIM compares, computed once for many comparisons. Costs by what the picture shows; the values are
/// those of the whole picture.
struct LumaPicture {
  PixelSpans spans;
  SpanImage luma;                     // sRGB-encoded, 0..1
  SpanImage mean, square_mean;        // under a Gaussian of deviation 1.5 px
  std::vector<std::uint8_t> covered;  // of the whole picture
};
LumaPicture prepare_luma(const Picture& picture);
/// `spans`: shown_spans() of the picture.
LumaPicture prepare_luma(const Picture& picture, const PixelSpans& spans);

struct PictureDifference {
  double ssim = 0;  // the sum over the pixels that either picture covers
  std::uint64_t pixels = 0;
};

/// SSIM of luma: Gaussian windows (11 x 11, deviation 1.5 px), C1 = 0.01^2, C2 = 0.03^2 (Wang et al. 2004).
PictureDifference compare_luma(const LumaPicture& reference, const LumaPicture& test);

}  // namespace texmesh
