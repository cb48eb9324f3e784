#pragma once
#include <array>

#include "stages/measure/picture.h"

namespace texmesh {

/// The parts of a picture that FLIP compares. They are computed once for a reference. Of each row one range
/// of columns is kept, around all that is not plain background; outside of it the plain values hold.
struct FlipPicture {
  struct Row {
    std::uint32_t first = 0, last = 0;  // columns first to last - 1
    std::size_t offset = 0;             // of `first` in the lists below
  };
  std::vector<Row> rows;
  std::vector<Vec3f> lab;                    // as the eye filters it, Hunt-adjusted
  std::array<std::vector<float>, 2> detail;  // strength of edges, of points
  std::vector<std::uint8_t> covered;
  Vec3f plain_lab;
  std::array<float, 2> plain_detail{};
};
/// Costs by what the picture shows; the values are those of the whole picture.
FlipPicture prepare_flip(const Picture& picture);

inline constexpr int kFlipSteps = 1024;

/// FLIP over the pixels that either picture covers, of any number of pictures.
struct FlipSum {
  double sum = 0;
  std::uint64_t pixels = 0;
  /// Pixels without a difference; then those of each step of 1 / kFlipSteps.
  std::vector<std::uint32_t> histogram = std::vector<std::uint32_t>(kFlipSteps + 1);
  void add(const FlipSum& other);
  double mean() const { return pixels ? sum / static_cast<double>(pixels) : 0; }
  /// The value that this part (0..1) of the pixels does not exceed, within 1 / kFlipSteps.
  double percentile(double part) const;
};

/// LDR-FLIP (Andersson, Nilsson, Akenine-Moeller, Oskarsson, Astrom, Fairchild: FLIP: A Difference Evaluator
/// for Alternating Images, 2020) over the pixels that either picture covers, at its standard 67 pixels per
/// degree: 0 = equal, 1 = black against white. Both parts, colours and features, as published; borders are
/// replicated. Both pictures have one size. Same bits on every machine.
FlipSum compare_flip(const FlipPicture& reference, const FlipPicture& test);
/// The same bits, of a picture that is compared once: filtered where one of the two covers pixels. `spans`:
/// shown_spans() of the picture, or more of it.
FlipSum compare_flip(const FlipPicture& reference, const Picture& test, const PixelSpans& spans);
FlipSum compare_flip(const FlipPicture& reference, const Picture& test);
/// The same of every pixel, row by row; 0 where neither picture shows the object.
std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test);
/// Its mean.
double flip_of(const FlipPicture& reference, const FlipPicture& test);

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
