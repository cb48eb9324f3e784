#include "pipeline/extract/flip.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "format/portable_math.h"
#include "stages/sampled_curve.h"

namespace texmesh {
namespace {

constexpr double kPixelsPerDegree = 67.0206432765;  // 0.7 m from a screen 0.7 m wide with 3840 px
constexpr double kWhite[3] = {0.950428545, 1.0, 1.088900371};
constexpr float kLabStart = 216.f / 24389;

using Curve = SampledCurve<16384>;

/// One row of a separable filter, of any parity.
using Kernel = std::vector<float>;  // [2 * radius + 1]

void filter_lines(const std::vector<float>& from, std::vector<float>& to, int side, std::size_t step,
                  std::size_t line_step, const Kernel& kernel) {
  const int radius = static_cast<int>(kernel.size() / 2);
  std::vector<float> line(static_cast<std::size_t>(side + 2 * radius));
  for (int l = 0; l < side; ++l) {
    const float* in = from.data() + static_cast<std::size_t>(l) * line_step;
    float* out = to.data() + static_cast<std::size_t>(l) * line_step;
    for (int i = -radius; i < side + radius; ++i)
      line[static_cast<std::size_t>(i + radius)] =
          in[static_cast<std::size_t>(std::clamp(i, 0, side - 1)) * step];
    for (int i = 0; i < side; ++i) {
      float sum = 0;
      const float* at = line.data() + i;
      for (std::size_t k = 0; k < kernel.size(); ++k) sum += at[k] * kernel[k];
      out[static_cast<std::size_t>(i) * step] = sum;
    }
  }
}

std::vector<float> filtered(const std::vector<float>& image, std::uint32_t side, const Kernel& along_x,
                            const Kernel& along_y) {
  std::vector<float> half(image.size()), out(image.size());
  filter_lines(image, half, static_cast<int>(side), 1, side, along_x);
  filter_lines(half, out, static_cast<int>(side), side, 1, along_y);
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
std::vector<float> seen(const std::vector<float>& channel, std::uint32_t side,
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
    const std::vector<float> part = filtered(channel, side, kernel, kernel);
    const auto weight = static_cast<float>(t.a * std::sqrt(portable::kPi / t.b) / whole);
    for (std::size_t i = 0; i < out.size(); ++i) out[i] += weight * part[i];
  }
  return out;
}

Vec3d xyz_of(Vec3f c) {
  return {0.4124564 * c.x + 0.3575761 * c.y + 0.1804375 * c.z,
          0.2126729 * c.x + 0.7151522 * c.y + 0.0721750 * c.z,
          0.0193339 * c.x + 0.1191920 * c.y + 0.9503041 * c.z};
}
Vec3f linear_of(double x, double y, double z) {
  return {static_cast<float>(3.2404542 * x - 1.5371385 * y - 0.4985314 * z),
          static_cast<float>(-0.9692660 * x + 1.8760108 * y + 0.0415560 * z),
          static_cast<float>(0.0556434 * x - 0.2040259 * y + 1.0572252 * z)};
}
Vec3f clamped(Vec3f c) {
  return {std::clamp(c.x, 0.f, 1.f), std::clamp(c.y, 0.f, 1.f), std::clamp(c.z, 0.f, 1.f)};
}

/// L*a*b* with colours counting for less in the dark (Hunt).
Vec3f hunt_lab(Vec3f rgb) {
  static const Curve root([](double x) {
    return x > static_cast<double>(kLabStart) ? portable::pow(x, 1.0 / 3) : (841.0 / 108) * x + 4.0 / 29;
  });
  const Vec3d xyz = xyz_of(rgb);
  const float fx = root(static_cast<float>(xyz.x / kWhite[0])), fy = root(static_cast<float>(xyz.y)),
              fz = root(static_cast<float>(xyz.z / kWhite[2]));
  const float lightness = 116 * fy - 16, share = 0.01f * lightness;
  return {lightness, share * 500 * (fx - fy), share * 200 * (fy - fz)};
}

float hyab(Vec3f a, Vec3f b) {
  const Vec3f d = a - b;
  return std::fabs(d.x) + std::sqrt(d.y * d.y + d.z * d.z);
}

/// x^0.7 of 0 .. 256, which holds every HyAB distance of colours.
float compressed(float distance) {
  static const Curve power([](double x) { return x > 0 ? portable::pow(x * 256, 0.7) : 0; });
  if (distance >= 0.5f) return power(distance / 256);
  return distance > 0 ? static_cast<float>(portable::pow(static_cast<double>(distance), 0.7)) : 0;
}

/// Small differences get nearly all of 0 .. 1.
float colour_difference(Vec3f a, Vec3f b) {
  static const float largest = compressed(hyab(hunt_lab({0, 1, 0}), hunt_lab({0, 0, 1})));
  constexpr float kKnee = 0.4f, kTop = 0.95f;
  const float d = compressed(hyab(a, b)), knee = kKnee * largest;
  return std::min(1.f, d < knee ? kTop / knee * d : kTop + (d - knee) / (largest - knee) * (1 - kTop));
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

std::vector<float> strength(const std::vector<float>& luma, std::uint32_t side, const Kernel& derivative) {
  const Kernel& smooth = feature_kernels().smooth;
  std::vector<float> out = filtered(luma, side, derivative, smooth);
  const std::vector<float> y = filtered(luma, side, smooth, derivative);
  for (std::size_t i = 0; i < out.size(); ++i) out[i] = std::sqrt(out[i] * out[i] + y[i] * y[i]);
  return out;
}

}  // namespace

FlipPicture prepare_flip(const Picture& picture) {
  const std::size_t count = picture.linear.size();
  std::array<std::vector<float>, 3> opponent;  // Y, Cx, Cz
  for (auto& channel : opponent) channel.resize(count);
  std::vector<float> luma(count);
  for (std::size_t i = 0; i < count; ++i) {
    const Vec3d xyz = xyz_of(clamped(picture.linear[i]));
    const double x = xyz.x / kWhite[0], y = xyz.y, z = xyz.z / kWhite[2];
    opponent[0][i] = static_cast<float>(116 * y - 16);
    opponent[1][i] = static_cast<float>(500 * (x - y));
    opponent[2][i] = static_cast<float>(200 * (y - z));
    luma[i] = static_cast<float>(y);
  }
  opponent[0] = seen(opponent[0], picture.side_px, {{1, 0.0047}});
  opponent[1] = seen(opponent[1], picture.side_px, {{1, 0.0053}});
  opponent[2] = seen(opponent[2], picture.side_px, {{34.1, 0.04}, {13.5, 0.025}});
  FlipPicture out;
  out.side_px = picture.side_px;
  out.covered = picture.covered;
  out.lab.resize(count);
  for (std::size_t i = 0; i < count; ++i) {
    const double y = (static_cast<double>(opponent[0][i]) + 16) / 116;
    const double x = y + static_cast<double>(opponent[1][i]) / 500,
                 z = y - static_cast<double>(opponent[2][i]) / 200;
    out.lab[i] = hunt_lab(clamped(linear_of(x * kWhite[0], y, z * kWhite[2])));
  }
  out.detail[0] = strength(luma, picture.side_px, feature_kernels().edge);
  out.detail[1] = strength(luma, picture.side_px, feature_kernels().point);
  return out;
}

double flip_of(const FlipPicture& reference, const FlipPicture& test) {
  double sum = 0;
  std::uint64_t pixels = 0;
  for (std::size_t i = 0; i < reference.lab.size(); ++i) {
    if (!reference.covered[i] && !test.covered[i]) continue;
    ++pixels;
    const double colour = static_cast<double>(colour_difference(reference.lab[i], test.lab[i]));
    if (!(colour > 0)) continue;
    const float edges = std::fabs(reference.detail[0][i] - test.detail[0][i]),
                points = std::fabs(reference.detail[1][i] - test.detail[1][i]);
    const double feature = std::sqrt(static_cast<double>(std::max(edges, points)) / std::sqrt(2.0));
    sum += portable::pow(colour, 1 - std::min(1.0, feature));
  }
  return pixels ? sum / static_cast<double>(pixels) : 0;
}

}  // namespace texmesh
