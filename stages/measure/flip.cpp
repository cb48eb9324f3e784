#include "stages/measure/flip.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "format/base/portable_math.h"
#include "stages/measure/cie_lab.h"
#include "stages/measure/sampled_curve.h"

namespace texmesh {
namespace {

constexpr double kPixelsPerDegree = 67.0206432765;  // 0.7 m from a screen 0.7 m wide with 3840 px

using FlipCurve = SampledCurve<16384>;

/// One row of a separable filter, of any parity.
using Kernel = std::vector<float>;  // [2 * radius + 1]

/// A rectangle of pixels.
struct PixelRectangle {
  int x = 0, y = 0, width = 0, height = 0;
  std::size_t count() const { return static_cast<std::size_t>(width) * static_cast<std::size_t>(height); }
};

/// Filters `lines` lines of `length` values that are `step` apart.
void filter_lines(const std::vector<float>& from, std::vector<float>& to, int length, int lines,
                  std::size_t step, std::size_t line_step, const Kernel& kernel) {
  const int radius = static_cast<int>(kernel.size() / 2);
  std::vector<float> line(static_cast<std::size_t>(length + 2 * radius));
  for (int l = 0; l < lines; ++l) {
    const float* in = from.data() + static_cast<std::size_t>(l) * line_step;
    float* out = to.data() + static_cast<std::size_t>(l) * line_step;
    for (int i = -radius; i < length + radius; ++i)
      line[static_cast<std::size_t>(i + radius)] =
          in[static_cast<std::size_t>(std::clamp(i, 0, length - 1)) * step];
    for (int i = 0; i < length; ++i) {
      float sum = 0;
      const float* at = line.data() + i;
      for (std::size_t k = 0; k < kernel.size(); ++k) sum += at[k] * kernel[k];
      out[static_cast<std::size_t>(i) * step] = sum;
    }
  }
}

std::vector<float> filtered(const std::vector<float>& image, const PixelRectangle& box, const Kernel& along_x,
                            const Kernel& along_y) {
  const auto stride = static_cast<std::size_t>(box.width);
  std::vector<float> half(image.size()), out(image.size());
  filter_lines(image, half, box.width, box.height, 1, stride, along_x);
  filter_lines(half, out, box.height, box.width, stride, 1, along_y);
  return out;
}

double sum_of(const Kernel& kernel) {
  double sum = 0;
  for (const float k : kernel) sum += static_cast<double>(k);
  return sum;
}

/// exp(-pi^2 x^2 / b), x in degrees: one term of a contrast sensitivity function.
Kernel sensitivity(double b, int radius) {
  Kernel out;
  for (int i = -radius; i <= radius; ++i) {
    const double x = i / kPixelsPerDegree;
    out.push_back(static_cast<float>(portable::exp(-portable::kPi * portable::kPi * x * x / b)));
  }
  return out;
}

/// The sum over terms of a sqrt(pi / b) exp(-pi^2 z / b), made one in the sum over the plane.
struct Term {
  double a, b;
};
std::vector<float> eye_filtered(const std::vector<float>& channel, const PixelRectangle& box,
                                std::initializer_list<Term> terms) {
  constexpr int kRadius = 10;  // three deviations of the widest term
  double whole = 0;
  for (const Term& t : terms) {
    const double line = sum_of(sensitivity(t.b, kRadius));
    whole += t.a * std::sqrt(portable::kPi / t.b) * line * line;
  }
  std::vector<float> out(channel.size());
  for (const Term& t : terms) {
    const Kernel kernel = sensitivity(t.b, kRadius);
    const std::vector<float> part = filtered(channel, box, kernel, kernel);
    const auto weight = static_cast<float>(t.a * std::sqrt(portable::kPi / t.b) / whole);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += weight * part[i];
  }
  return out;
}

const FlipCurve& flip_lab_curve() {
  static const FlipCurve curve(lab_root);
  return curve;
}

/// x^0.7 of 0 .. 256, which holds every HyAB distance of colours.
float flip_compressed(float distance) {
  static const FlipCurve power([](double x) { return x > 0 ? portable::pow(x * 256, kHyabExponent) : 0; });
  if (distance >= 0.5f) return power(distance / 256);
  return distance > 0 ? static_cast<float>(portable::pow(static_cast<double>(distance), kHyabExponent)) : 0;
}

float flip_colour_difference(Vec3f a, Vec3f b) {
  static const float largest = flip_compressed(largest_hyab<float>(flip_lab_curve()));
  return remapped_difference(flip_compressed(hyab<float>(a, b)), largest);
}

/// Derivatives of a Gaussian as wide as features that the eye looks for: first (edges), second (points); the
/// weights of either sign sum to 1.
struct FeatureKernels {
  Kernel smooth, edge, point;
};
const FeatureKernels& feature_kernels() {
  static const FeatureKernels kernels = [] {
    constexpr double kWidth = 0.082;
    const double deviation = 0.5 * kWidth * kPixelsPerDegree;
    const int radius = static_cast<int>(std::ceil(3 * deviation));
    FeatureKernels k;
    for (int i = -radius; i <= radius; ++i) {
      const double g = portable::exp(-i * i / (2 * deviation * deviation));
      k.smooth.push_back(static_cast<float>(g));
      k.edge.push_back(static_cast<float>(-i * g));
      k.point.push_back(static_cast<float>((i * i / (deviation * deviation) - 1) * g));
    }
    const auto balance = [](Kernel& kernel) {
      double positive = 0, negative = 0;
      for (const float v : kernel) (v > 0 ? positive : negative) += std::fabs(static_cast<double>(v));
      for (float& v : kernel) v = static_cast<float>(static_cast<double>(v) / (v > 0 ? positive : negative));
    };
    const double whole = sum_of(k.smooth);
    for (float& v : k.smooth) v = static_cast<float>(static_cast<double>(v) / whole);
    balance(k.edge);
    balance(k.point);
    return k;
  }();
  return kernels;
}

std::vector<float> feature_strength(const std::vector<float>& luma, const PixelRectangle& box,
                                    const Kernel& derivative) {
  const Kernel& smooth = feature_kernels().smooth;
  std::vector<float> out = filtered(luma, box, derivative, smooth);
  const std::vector<float> y = filtered(luma, box, smooth, derivative);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = std::sqrt(out[i] * out[i] + y[i] * y[i]);
  return out;
}

/// What is not plain background, and so far around it that filters neither see it nor are seen by it.
PixelRectangle shown_rectangle(const Picture& picture) {
  constexpr int kReach = 24;
  const int side = static_cast<int>(picture.side_px);
  int x0 = side, y0 = side, x1 = 0, y1 = 0;
  for (int y = 0; y < side; ++y)
    for (int x = 0; x < side; ++x) {
      const auto i = static_cast<std::size_t>(y) * picture.side_px + static_cast<std::size_t>(x);
      if (!picture.covered[i] && picture.linear[i] == picture.linear[0]) continue;
      x0 = std::min(x0, x), x1 = std::max(x1, x + 1);
      y0 = std::min(y0, y), y1 = std::max(y1, y + 1);
    }
  x0 = std::max(std::min(x0, x1) - kReach, 0), y0 = std::max(std::min(y0, y1) - kReach, 0);
  return {x0, y0, std::min(x1 + kReach, side) - x0, std::min(y1 + kReach, side) - y0};
}

/// A pixel of the box that only sees background, where the box is not the whole picture.
std::size_t plain_pixel(const PixelRectangle& box) { return box.x > 0 || box.y > 0 ? 0 : box.count() - 1; }

/// Puts the values of a box into a whole picture, plain background around them.
template <class T>
std::vector<T> in_whole_picture(const std::vector<T>& part, const PixelRectangle& box, std::uint32_t side) {
  std::vector<T> out(std::size_t{side} * side, part[plain_pixel(box)]);
  for (int y = 0; y < box.height; ++y)
    std::copy_n(part.begin() + static_cast<std::ptrdiff_t>(y) * box.width, box.width,
                out.begin() + static_cast<std::ptrdiff_t>(box.y + y) * side + box.x);
  return out;
}

}  // namespace

FlipPicture prepare_flip(const Picture& picture) {
  FlipPicture out;
  out.side_px = picture.side_px;
  out.covered = picture.covered;
  if (picture.linear.empty()) return out;
  const PixelRectangle box = shown_rectangle(picture);
  std::array<std::vector<float>, 3> opponent;  // Y, Cx, Cz
  for (auto& channel : opponent) channel.resize(box.count());
  std::vector<float> luma(box.count());
  for (std::size_t i = 0; i < luma.size(); ++i) {
    const std::size_t x = i % static_cast<std::size_t>(box.width) + static_cast<std::size_t>(box.x),
                      y = i / static_cast<std::size_t>(box.width) + static_cast<std::size_t>(box.y);
    const Vec3d xyz = xyz_of_linear(clamped_colour(picture.linear[y * picture.side_px + x]));
    const Vec3f colour = to_float(opponent_of_xyz(xyz));
    for (int c = 0; c < 3; ++c) opponent[static_cast<std::size_t>(c)][i] = colour[c];
    luma[i] = static_cast<float>(xyz.y);
  }
  opponent[0] = eye_filtered(opponent[0], box, {{1, 0.0047}});
  opponent[1] = eye_filtered(opponent[1], box, {{1, 0.0053}});
  opponent[2] = eye_filtered(opponent[2], box, {{34.1, 0.04}, {13.5, 0.025}});
  std::vector<Vec3f> lab(box.count());
  for (std::size_t i = 0; i < lab.size(); ++i) {
    const Vec3d xyz = xyz_of_opponent(to_double(Vec3f{opponent[0][i], opponent[1][i], opponent[2][i]}));
    lab[i] = hunt_lab(xyz_of_linear(clamped_colour(linear_of_xyz(xyz))), flip_lab_curve());
  }
  out.lab = in_whole_picture(lab, box, picture.side_px);
  out.detail[0] = in_whole_picture(feature_strength(luma, box, feature_kernels().edge), box, picture.side_px);
  out.detail[1] =
      in_whole_picture(feature_strength(luma, box, feature_kernels().point), box, picture.side_px);
  return out;
}

double flip_of(const FlipPicture& reference, const FlipPicture& test) {
  double sum = 0;
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i < reference.lab.size(); ++i) {
    if (!reference.covered[i] && !test.covered[i]) continue;
    ++pixels;
    const double colour = static_cast<double>(flip_colour_difference(reference.lab[i], test.lab[i]));
    if (!(colour > 0)) continue;
    const float edges = std::fabs(reference.detail[0][i] - test.detail[0][i]),
                points = std::fabs(reference.detail[1][i] - test.detail[1][i]);
    const double feature = std::sqrt(static_cast<double>(std::max(edges, points)) / std::sqrt(2.0));
    sum += portable::pow(colour, 1 - std::min(1.0, feature));
  }
  return pixels ? sum / static_cast<double>(pixels) : 0;
}

}  // namespace texmesh
