#include "stages/measure/image_compare.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "format/base/portable_math.h"
#include "format/base/srgb.h"
#include "stages/measure/sampled_curve.h"

namespace texmesh {
namespace {

using Curve = SampledCurve<8192>;  // finer than 8-bit pictures can show

const Curve& srgb_curve() {
  static const Curve curve(srgb_of_light);
  return curve;
}
const Curve& lab_curve() {
  static const Curve curve(
      [](double x) { return x > 216.0 / 24389 ? portable::pow(x, 1.0 / 3) : (841.0 / 108) * x + 4.0 / 29; });
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

constexpr double kWhite[3] = {0.950428545, 1.0, 1.088900371};  // D65, as FLIP has it

Vec3d xyz_from_linear(Vec3d c) {
  return {0.4124564 * c.x + 0.3575761 * c.y + 0.1804375 * c.z,
          0.2126729 * c.x + 0.7151522 * c.y + 0.0721750 * c.z,
          0.0193339 * c.x + 0.1191920 * c.y + 0.9503041 * c.z};
}

Vec3f hunt_lab(Vec3d xyz) {
  const float fx = lab_curve()(static_cast<float>(xyz.x / kWhite[0]));
  const float fy = lab_curve()(static_cast<float>(xyz.y / kWhite[1]));
  const float fz = lab_curve()(static_cast<float>(xyz.z / kWhite[2]));
  const float lightness = 116 * fy - 16;
  // Colours count for less in the dark (Hunt).
  return {lightness, 0.01f * lightness * 500 * (fx - fy), 0.01f * lightness * 200 * (fy - fz)};
}

double hyab(Vec3f a, Vec3f b) {
  const Vec3f d = a - b;
  return std::fabs(static_cast<double>(d.x)) + std::sqrt(static_cast<double>(d.y * d.y + d.z * d.z));
}

// FLIP's exponent, and the remapping that gives small differences nearly all of 0..1.
class Remap {
 public:
  Remap()
      : largest_(power(hyab(hunt_lab(xyz_from_linear({0, 1, 0})), hunt_lab(xyz_from_linear({0, 0, 1}))))) {}
  double operator()(double distance) const {
    constexpr double kKnee = 0.4, kTop = 0.95;
    const double p = power(distance), knee = kKnee * largest_;
    return std::min(1.0, p < knee ? kTop / knee * p : kTop + (p - knee) / (largest_ - knee) * (1 - kTop));
  }

 private:
  static double power(double x) { return x > 0 ? portable::pow(x, 0.7) : 0; }
  double largest_;
};

std::vector<Vec3f> eye_lab(const Picture& picture) {
  const std::size_t count = picture.linear.size();
  std::array<std::vector<float>, 3> opponent;  // Y, Cx, Cz
  for (auto& channel : opponent) channel.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3f c = picture.linear[i];
    const Vec3d xyz =
        xyz_from_linear({std::clamp(c.x, 0.f, 1.f), std::clamp(c.y, 0.f, 1.f), std::clamp(c.z, 0.f, 1.f)});
    const double x = xyz.x / kWhite[0], y = xyz.y / kWhite[1], z = xyz.z / kWhite[2];
    opponent[0][i] = static_cast<float>(116 * y - 16);
    opponent[1][i] = static_cast<float>(500 * (x - y));
    opponent[2][i] = static_cast<float>(200 * (y - z));
  }
  static const Gaussian kAchromatic(1.03, 3), kRedGreen(1.10, 3), kBlueYellow(2.9, 8);
  kAchromatic.blur(opponent[0], picture.side_px);
  kRedGreen.blur(opponent[1], picture.side_px);
  kBlueYellow.blur(opponent[2], picture.side_px);
  std::vector<Vec3f> lab(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double y = (static_cast<double>(opponent[0][i]) + 16) / 116;
    const double x = y + static_cast<double>(opponent[1][i]) / 500,
                 z = y - static_cast<double>(opponent[2][i]) / 200;
    lab[i] = hunt_lab({x * kWhite[0], y * kWhite[1], z * kWhite[2]});
  }
  return lab;
}

}  // namespace

ComparedPicture prepare_comparison(const Picture& picture) {
  ComparedPicture out;
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
  out.lab = eye_lab(picture);
  return out;
}

PictureDifference compare_pictures(const ComparedPicture& reference, const ComparedPicture& test) {
  static const Remap kRemap;
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
    sum.difference += kRemap(hyab(reference.lab[i], test.lab[i]));
    ++sum.pixels;
  }
  return sum;
}

}  // namespace texmesh
