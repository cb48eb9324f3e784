#pragma once
#include <cstdint>
#include <vector>

#include "format/base/vec.h"
#include "stages/measure/picture.h"

namespace texmesh {

/// What SSIM compares, computed once for many comparisons. Costs by what the picture shows; the values are
/// those of the whole picture.
struct LumaPicture {
  measure::PixelSpans spans;
  measure::SpanImage luma;               // sRGB-encoded, 0..1
  measure::SpanImage mean, square_mean;  // under a Gaussian of deviation 1.5 px
  std::vector<std::uint8_t> covered;     // of the whole picture
};
LumaPicture prepare_luma(const Picture& picture);
/// `spans`: shown_spans() of the picture.
LumaPicture prepare_luma(const Picture& picture, const measure::PixelSpans& spans);

/// The same with what the colour difference compares.
struct ComparedPicture : LumaPicture {
  std::vector<Vec3f> lab;  // after the eye's blur, Hunt-adjusted
};
ComparedPicture prepare_comparison(const Picture& picture);

struct PictureDifference {
  double ssim = 0, difference = 0;  // sums over the pixels that either picture covers
  std::uint64_t pixels = 0;
};

/// SSIM of luma: Gaussian windows (11 x 11, deviation 1.5 px), C1 = 0.01^2, C2 = 0.03^2 (Wang et al. 2004).
/// Difference: the colour part of LDR-FLIP (Andersson et al. 2020) at its standard 67 px per degree: opponent
/// colours blurred as the eye does at that distance (one Gaussian a channel: 1.03 px achromatic, 1.10 px
/// red-green, 2.9 px blue-yellow, FLIP's own filter taken as one instead of two), Hunt-adjusted L*a*b*, HyAB
/// distance, its exponent 0.7 and its remapping to 0..1. FLIP's edge and point detectors are left out: SSIM
/// stands beside it for structure.
PictureDifference compare_pictures(const ComparedPicture& reference, const ComparedPicture& test);
/// SSIM and the pixels alone; the difference stays 0.
PictureDifference compare_luma(const LumaPicture& reference, const LumaPicture& test);

}  // namespace texmesh
