#include "stages/measure/flip.h"

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"
#include "stages/measure/cie_lab.h"
#include "stages/measure/pixel_spans.h"
#include "stages/measure/sampled_curve.h"

namespace texmesh {
namespace {

constexpr double kPixelsPerDegree = 67.0206432765;  // 0.7 m from a screen 0.7 m wide with 3840 px

using FlipCurve = SampledCurve<16384>;
using measure::filtered;
using measure::Kernel;
using measure::PixelSpans;
using measure::SpanImage;

double sum_of(const Kernel& kernel) {
  double sum = 0;
  for (const float k : kernel) sum += static_cast<double>(k);
  return sum;
}

/// exp(-pi^2 x^2 / b), x in degrees: one term of a contrast sensitivity function. Three deviations of the
/// widest term; narrow ones end where single precision no longer sees them.
Kernel sensitivity(double b) {
  constexpr double kUnseen = 1e-9;
  Kernel out;
  for (int i = -measure::kFilterReach; i <= measure::kFilterReach; ++i) {
    const double x = i / kPixelsPerDegree;
    const double weight = portable::exp(-portable::kPi * portable::kPi * x * x / b);
    if (weight > kUnseen) out.push_back(static_cast<float>(weight));
  }
  return out;
}

/// The sum over terms of a sqrt(pi / b) exp(-pi^2 z / b), made one in the sum over the plane.
struct Term {
  double a, b;
};
SpanImage eye_filtered(const SpanImage& channel, const PixelSpans& spans, std::initializer_list<Term> terms) {
  double whole = 0;
  for (const Term& t : terms) {
    const double line = sum_of(sensitivity(t.b));
    whole += t.a * std::sqrt(portable::kPi / t.b) * line * line;
  }
  SpanImage out{std::vector<float>(spans.count), 0};
  for (const Term& t : terms) {
    const Kernel kernel = sensitivity(t.b);
    const SpanImage part = filtered(channel, spans, kernel, kernel);
    const auto weight = static_cast<float>(t.a * std::sqrt(portable::kPi / t.b) / whole);
    for (std::size_t i = 0; i < out.values.size(); ++i) out.values[i] += weight * part.values[i];
    out.plain += weight * part.plain;
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

float strength(float x, float y) { return std::sqrt(x * x + y * y); }

SpanImage feature_strength(const SpanImage& luma, const PixelSpans& spans, const Kernel& derivative) {
  const Kernel& smooth = feature_kernels().smooth;
  SpanImage out = filtered(luma, spans, derivative, smooth);
  const SpanImage y = filtered(luma, spans, smooth, derivative);
  for (std::size_t i = 0; i < out.values.size(); ++i) out.values[i] = strength(out.values[i], y.values[i]);
  out.plain = strength(out.plain, y.plain);
  return out;
}

/// Y, Cx, Cz, and the luma that features are seen in.
struct Channels {
  std::array<SpanImage, 3> opponent;
  SpanImage luma;
};

Channels channels_of(const Picture& picture, const PixelSpans& spans) {
  Channels out;
  for (SpanImage& channel : out.opponent) channel.values.resize(spans.count);
  out.luma.values.resize(spans.count);
  const auto convert = [](Vec3f linear, auto&& opponent_at, float& luma) {
    const Vec3d xyz = xyz_of_linear(clamped_colour(linear));
    const Vec3f colour = to_float(opponent_of_xyz(xyz));
    for (int c = 0; c < 3; ++c) opponent_at(c) = colour[c];
    luma = static_cast<float>(xyz.y);
  };
  for (std::size_t y = 0; y < spans.rows.size(); ++y) {
    const PixelSpans::Row& row = spans.rows[y];
    for (std::size_t x = row.first; x < row.last; ++x) {
      const std::size_t i = row.offset + (x - row.first);
      convert(
          picture.linear[y * picture.side_px + x],
          [&](int c) -> float& { return out.opponent[static_cast<std::size_t>(c)].values[i]; },
          out.luma.values[i]);
    }
  }
  convert(
      picture.linear[0], [&](int c) -> float& { return out.opponent[static_cast<std::size_t>(c)].plain; },
      out.luma.plain);
  return out;
}

Vec3f flip_lab(Vec3f opponent) {
  const Vec3d xyz = xyz_of_opponent(to_double(opponent));
  return hunt_lab(xyz_of_linear(clamped_colour(linear_of_xyz(xyz))), flip_lab_curve());
}

/// What the comparison reads of one picture at one pixel.
struct Seen {
  Vec3f lab;
  std::array<float, 2> detail;
  bool covered;
};
Seen seen_at(const FlipPicture& picture, std::size_t y, std::uint32_t x) {
  const FlipPicture::Row& row = picture.rows[y];
  if (x < row.first || x >= row.last) return {picture.plain_lab, picture.plain_detail, false};
  const std::size_t i = row.offset + (x - row.first);
  return {picture.lab[i], {picture.detail[0][i], picture.detail[1][i]}, picture.covered[i] != 0};
}

double flip_at(const Seen& reference, const Seen& test) {
  const double colour = static_cast<double>(flip_colour_difference(reference.lab, test.lab));
  if (!(colour > 0)) return 0;
  const float edges = std::fabs(reference.detail[0] - test.detail[0]),
              points = std::fabs(reference.detail[1] - test.detail[1]);
  const double feature = std::sqrt(static_cast<double>(std::max(edges, points)) / std::sqrt(2.0));
  return portable::pow(colour, 1 - std::min(1.0, feature));
}

/// Calls visit(x, y, FLIP) for every pixel that either picture covers, row by row.
template <class Visit>
void for_each_flip(const FlipPicture& reference, const FlipPicture& test, Visit&& visit) {
  for (std::size_t y = 0; y < reference.rows.size(); ++y) {
    const FlipPicture::Row &a = reference.rows[y], &b = test.rows[y];
    const bool none = a.first == a.last;
    const std::uint32_t first = none ? b.first : b.first == b.last ? a.first : std::min(a.first, b.first);
    for (std::uint32_t x = first; x < std::max(a.last, b.last); ++x) {
      const Seen r = seen_at(reference, y, x), t = seen_at(test, y, x);
      if (r.covered || t.covered) visit(std::size_t{x}, y, flip_at(r, t));
    }
  }
}

}  // namespace

void FlipSum::add(const FlipSum& other) {
  sum += other.sum;
  pixels += other.pixels;
  for (std::size_t i = 0; i < histogram.size(); ++i) histogram[i] += other.histogram[i];
}

double FlipSum::percentile(double part) const {
  const double rank = part * static_cast<double>(pixels);
  double below = 0;
  for (std::size_t i = 0; i < histogram.size(); ++i) {
    const double here = histogram[i];
    if (here > 0 && below + here >= rank)
      return i == 0 ? 0 : (static_cast<double>(i - 1) + (rank - below) / here) / kFlipSteps;
    below += here;
  }
  return 0;
}

FlipPicture prepare_flip(const Picture& picture) {
  FlipPicture out;
  if (picture.linear.empty()) return out;
  const PixelSpans spans = measure::shown_spans(picture);
  for (std::size_t y = 0; y < spans.rows.size(); ++y) {
    const PixelSpans::Row& row = spans.rows[y];
    out.rows.push_back({row.first, row.last, row.offset});
    const auto covered = picture.covered.begin() + static_cast<std::ptrdiff_t>(y * picture.side_px);
    out.covered.insert(out.covered.end(), covered + row.first, covered + row.last);
  }
  Channels channels = channels_of(picture, spans);
  std::array<SpanImage, 3>& opponent = channels.opponent;
  opponent[0] = eye_filtered(opponent[0], spans, {{1, 0.0047}});
  opponent[1] = eye_filtered(opponent[1], spans, {{1, 0.0053}});
  opponent[2] = eye_filtered(opponent[2], spans, {{34.1, 0.04}, {13.5, 0.025}});
  out.lab.resize(spans.count);
  for (std::size_t i = 0; i < out.lab.size(); ++i)
    out.lab[i] = flip_lab({opponent[0].values[i], opponent[1].values[i], opponent[2].values[i]});
  out.plain_lab = flip_lab({opponent[0].plain, opponent[1].plain, opponent[2].plain});
  const Kernel* features[2] = {&feature_kernels().edge, &feature_kernels().point};
  for (std::size_t k = 0; k < 2; ++k) {
    SpanImage detail = feature_strength(channels.luma, spans, *features[k]);
    out.detail[k] = std::move(detail.values);
    out.plain_detail[k] = detail.plain;
  }
  return out;
}

FlipSum compare_flip(const FlipPicture& reference, const FlipPicture& test) {
  FlipSum sum;
  for_each_flip(reference, test, [&](std::size_t, std::size_t, double flip) {
    const auto step = static_cast<std::size_t>(std::clamp(flip * kFlipSteps, 0.0, kFlipSteps - 1.0));
    ++sum.pixels;
    ++sum.histogram[flip > 0 ? step + 1 : 0];
    sum.sum += flip;
  });
  return sum;
}

std::vector<float> flip_map(const FlipPicture& reference, const FlipPicture& test) {
  const std::size_t side = reference.rows.size();
  std::vector<float> map(side * side, 0);
  for_each_flip(reference, test, [&](std::size_t x, std::size_t y, double flip) {
    map[y * side + x] = static_cast<float>(flip);
  });
  return map;
}

double flip_of(const FlipPicture& reference, const FlipPicture& test) {
  return compare_flip(reference, test).mean();
}

}  // namespace texmesh
