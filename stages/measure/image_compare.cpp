#include "stages/measure/image_compare.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "format/base/portable_math.h"
#include "format/base/srgb.h"
#include "stages/measure/cie_lab.h"
#include "stages/measure/sampled_curve.h"

namespace texmesh {
namespace {

using Curve = SampledCurve<8192>;  // finer than 8-bit pictures can show

const Curve& srgb_curve() {
  static const Curve curve(srgb_of_light);
  return curve;
}
const Curve& lab_curve() {
  static const Curve curve(lab_root);
  return curve;
}

class Gaussian {
 public:
  Gaussian(double deviation, int radius) : radius_(radius) {
    double sum = 0;
    for (int i = -radius; i <= radius; ++i) sum += portable::exp(-i * i / (2 * deviation * deviation));
    for (int i = 0; i <= radius; ++i)
      weights_.push_back(static_cast<float>(portable::exp(-i * i / (2 * deviation * deviation)) / sum));
  }

  // Edges are replicated.
  void blur(std::vector<float>& image, std::uint32_t side) const {
    const int n = static_cast<int>(side);
    std::vector<float> line(side), sums(side);
    auto pass = [&](std::size_t start, std::size_t stride) {
      for (std::size_t i = 0; i < side; ++i) line[i] = image[start + i * stride];
      for (int i = 0; i < n; ++i) {
        float sum = weights_[0] * line[static_cast<std::size_t>(i)];
        for (int k = 1; k <= radius_; ++k)
          sum += weights_[static_cast<std::size_t>(k)] *
                 (line[static_cast<std::size_t>(std::max(0, i - k))] +
                  line[static_cast<std::size_t>(std::min(n - 1, i + k))]);
        sums[static_cast<std::size_t>(i)] = sum;
      }
      for (std::size_t i = 0; i < side; ++i) image[start + i * stride] = sums[i];
    };
    for (std::size_t y = 0; y < side; ++y) pass(y * side, 1);
    for (std::size_t x = 0; x < side; ++x) pass(x, side);
  }

 private:
  int radius_;
  std::vector<float> weights_;
};

const Gaussian& ssim_window() {
  static const Gaussian window(1.5, 5);
  return window;
}

double compressed(double distance) { return distance > 0 ? portable::pow(distance, kHyabExponent) : 0; }

double colour_difference(Vec3f a, Vec3f b) {
  static const double largest = compressed(largest_hyab<double>(lab_curve()));
  return remapped_difference(compressed(hyab<double>(a, b)), largest);
}

std::vector<Vec3f> eye_lab(const Picture& picture) {
  const std::size_t count = picture.linear.size();
  std::array<std::vector<float>, 3> opponent;  // Y, Cx, Cz
  for (auto& channel : opponent) channel.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f colour = to_float(opponent_of_xyz(xyz_of_linear(clamped_colour(picture.linear[i]))));
    for (int c = 0; c < 3; ++c) opponent[static_cast<std::size_t>(c)][i] = colour[c];
  }
  static const Gaussian kAchromatic(1.03, 3), kRedGreen(1.10, 3), kBlueYellow(2.9, 8);
  kAchromatic.blur(opponent[0], picture.side_px);
  kRedGreen.blur(opponent[1], picture.side_px);
  kBlueYellow.blur(opponent[2], picture.side_px);
  std::vector<Vec3f> lab(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f colour{opponent[0][i], opponent[1][i], opponent[2][i]};
    lab[i] = hunt_lab(xyz_of_opponent(to_double(colour)), lab_curve());
  }
  return lab;
}

}  // namespace

LumaPicture prepare_luma(const Picture& picture) {
  LumaPicture out;
  out.side_px = picture.side_px;
  out.covered = picture.covered;
  out.luma.resize(picture.linear.size());
  for (std::size_t i = 0; i < picture.linear.size(); ++i) {
    const Vec3f c = picture.linear[i];
    out.luma[i] = 0.2126f * srgb_curve()(c.x) + 0.7152f * srgb_curve()(c.y) + 0.0722f * srgb_curve()(c.z);
  }
  out.luma_mean = out.luma;
  ssim_window().blur(out.luma_mean, out.side_px);
  out.luma_square_mean.resize(out.luma.size());
  for (std::size_t i = 0; i < out.luma.size(); ++i) out.luma_square_mean[i] = out.luma[i] * out.luma[i];
  ssim_window().blur(out.luma_square_mean, out.side_px);
  return out;
}

ComparedPicture prepare_comparison(const Picture& picture) {
  return {prepare_luma(picture), eye_lab(picture)};
}

PictureDifference compare_luma(const LumaPicture& reference, const LumaPicture& test) {
  constexpr double kC1 = 0.01 * 0.01, kC2 = 0.03 * 0.03;
  std::vector<float> product(reference.luma.size());
  for (std::size_t i = 0; i < product.size(); ++i) product[i] = reference.luma[i] * test.luma[i];
  ssim_window().blur(product, reference.side_px);
  PictureDifference sum;
  for (std::size_t i = 0; i < product.size(); ++i) {
    if (!reference.covered[i] && !test.covered[i]) continue;
    const double a = reference.luma_mean[i], b = test.luma_mean[i];
    const double va = reference.luma_square_mean[i] - a * a, vb = test.luma_square_mean[i] - b * b;
    const double covariance = product[i] - a * b;
    sum.ssim += (2 * a * b + kC1) * (2 * covariance + kC2) / ((a * a + b * b + kC1) * (va + vb + kC2));
    ++sum.pixels;
  }
  return sum;
}

PictureDifference compare_pictures(const ComparedPicture& reference, const ComparedPicture& test) {
  PictureDifference sum = compare_luma(reference, test);
  for (std::size_t i = 0; i < reference.lab.size(); ++i)
    if (reference.covered[i] || test.covered[i])
      sum.difference += colour_difference(reference.lab[i], test.lab[i]);
  return sum;
}

}  // namespace texmesh
