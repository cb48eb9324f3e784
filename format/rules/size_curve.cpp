#include "format/rules/size_curve.h"

#include <algorithm>

#include "format/base/portable_math.h"
#include "format/rules/allocation.h"

namespace texmesh {
namespace {

// Luma quantisers of ISO/IEC 10918-1, table K.1: what IJG's scale multiplies. Their order does
// not matter here.
constexpr std::array<int, 64> kLumaQuantisers{
    16, 11,  10,  16, 24, 40, 51, 61, 12,  12,  14,  19,  26, 58, 60, 55,  14,  13,  16,  24, 40, 57,
    69, 56,  14,  17, 22, 29, 51, 87, 80,  62,  18,  22,  37, 56, 68, 109, 103, 77,  24,  35, 55, 64,
    81, 104, 113, 92, 49, 64, 78, 87, 103, 121, 120, 101, 72, 92, 95, 98,  112, 100, 103, 99};

/// How fine a whole quality quantises: log of the mean of 1 / (step + 1). Unlike g(Q) it knows that steps are
/// whole numbers from 1 to 255, which is what bends sizes at both ends; 1 instead of the dead zone's half
/// fitted best. Strictly rising.
double measure_fineness(int quality) {
  const int percent = quality < 50 ? 5000 / quality : 200 - 2 * quality;
  std::array<std::uint16_t, 64> steps;
  std::ranges::transform(kLumaQuantisers, steps.begin(), [&](int q) {
    return static_cast<std::uint16_t>(std::clamp((q * percent + 50) / 100, 1, 255));
  });
  return fineness_of(steps);
}

/// Of any quality: linear between the whole ones.
double fineness(double quality) {
  const double q = quality > 1 ? std::min(quality, 100.0) : 1.0;
  const int below = static_cast<int>(q);
  const double low = fineness_at_quality(below), part = q - below;
  return part > 0 ? low + part * (fineness_at_quality(below + 1) - low) : low;
}

/// Slope of the monotone cubic (Fritsch and Butland 1984) at an inner knot, from the secants on both sides.
double knot_slope(double width_before, double secant_before, double width_after, double secant_after) {
  if (secant_before * secant_after <= 0) return 0;
  const double a = 2 * width_after + width_before, b = width_after + 2 * width_before;
  return (a + b) / (a / secant_before + b / secant_after);
}

/// Value at x between the knots k and k + 1.
double hermite(const std::vector<double>& x, const std::vector<double>& y, std::size_t k, double at) {
  const auto secant = [&](std::size_t i) { return (y[i + 1] - y[i]) / (x[i + 1] - x[i]); };
  const auto slope = [&](std::size_t i) {
    if (i == 0) return secant(0);
    if (i + 1 == x.size()) return secant(i - 1);
    return knot_slope(x[i] - x[i - 1], secant(i - 1), x[i + 1] - x[i], secant(i));
  };
  const double h = x[k + 1] - x[k], t = (at - x[k]) / h;
  return y[k] * ((1 + 2 * t) * (1 - t) * (1 - t)) + h * slope(k) * (t * (1 - t) * (1 - t)) +
         y[k + 1] * (t * t * (3 - 2 * t)) + h * slope(k + 1) * (t * t * (t - 1));
}

/// What holds a plane's axis: a quality, and the part of the way between the rungs around it.
struct AxisKnot {
  double quality, position;
};

/// Where a quality lies on the plane's axis: its fineness at rungs and without knots; between knots and rungs
/// linear in fineness.
double axis_at(const PlaneTables& t, double quality) {
  const auto above = std::upper_bound(t.rung_quality.begin(), t.rung_quality.end(), quality);
  if (t.knot_quality.empty() || above == t.rung_quality.begin() || above == t.rung_quality.end())
    return fineness(quality);
  AxisKnot a{static_cast<double>(*(above - 1)), 0}, b{static_cast<double>(*above), 1};
  const double low = fineness(a.quality), high = fineness(b.quality);
  const auto knot = [&t](std::size_t k) {
    return AxisKnot{static_cast<double>(t.knot_quality[k]), static_cast<double>(t.knot_position[k])};
  };
  const auto k = static_cast<std::size_t>(
      std::upper_bound(t.knot_quality.begin(), t.knot_quality.end(), quality) - t.knot_quality.begin());
  if (k > 0 && knot(k - 1).quality > a.quality) a = knot(k - 1);
  if (k < t.knot_quality.size() && knot(k).quality < b.quality) b = knot(k);
  const double from = fineness(a.quality);
  const double part = (fineness(quality) - from) / (fineness(b.quality) - from);
  return low + (a.position + part * (b.position - a.position)) * (high - low);
}

/// log R = B log(100 p), by (8.8).
double log_r(const SizeModel& model, double vqp) {
  return static_cast<double>(model.b) * portable::log(100 * std::max(vqp, kLeastModelVqp));
}

bool has_model(const SizeModel& model) { return model.a > 0 && model.b > 0; }

}  // namespace

double fineness_of(std::span<const std::uint16_t> quantisers) {
  double sum = 0;
  for (const std::uint16_t q : quantisers) sum += 1.0 / (q + 1);
  return portable::log(sum / static_cast<double>(quantisers.size()));
}

double fineness_at_quality(int quality) {
  // Looked up: every fragment's every rung asks.
  static const std::array<double, 101> by_quality = [] {
    std::array<double, 101> out{};
    for (int q = 1; q <= 100; ++q) out[static_cast<std::size_t>(q)] = measure_fineness(q);
    return out;
  }();
  return by_quality[static_cast<std::size_t>(quality)];
}

double interpolated_bytes(const PlaneTables& tables, std::size_t fragment, double quality) {
  std::vector<double> x, y;  // fineness, ln bytes
  for (std::size_t r = 0; r < tables.rung_count(); ++r) {
    const auto bytes = static_cast<double>(bytes_to_show(tables, r, fragment));
    if (bytes <= 0) continue;
    if (quality == static_cast<double>(tables.rung_quality[r])) return bytes;
    x.push_back(fineness(tables.rung_quality[r]));
    y.push_back(portable::log(bytes));
  }
  if (x.empty()) return 0;
  const double at = axis_at(tables, quality);
  if (at <= x.front()) return portable::exp(y.front());
  if (at >= x.back()) return portable::exp(y.back());
  const auto k = static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), at) - x.begin()) - 1;
  return portable::exp(hermite(x, y, k, at));
}

std::vector<float> knot_positions(const std::vector<std::uint8_t>& rung_quality,
                                  const std::vector<double>& rung_bytes,
                                  const std::vector<std::uint8_t>& knot_quality,
                                  const std::vector<double>& knot_bytes) {
  constexpr int kHalvings = 20;  // finer than what is stored
  std::vector<double> x, y;
  for (std::size_t r = 0; r < rung_quality.size(); ++r) {
    x.push_back(fineness(rung_quality[r]));
    y.push_back(portable::log(rung_bytes[r]));
  }
  std::vector<float> out;
  std::size_t last_rung = 0;
  for (std::size_t k = 0; k < knot_quality.size(); ++k) {
    const auto above = std::upper_bound(rung_quality.begin(), rung_quality.end(), knot_quality[k]);
    const auto rung = static_cast<std::size_t>(above - rung_quality.begin()) - 1;
    const double width = x[rung + 1] - x[rung], wanted = portable::log(knot_bytes[k]);
    double low = 0, high = 1;
    if (y[rung + 1] > y[rung])
      for (int step = 0; step < kHalvings; ++step) {
        const double middle = (low + high) / 2;
        (hermite(x, y, rung, x[rung] + middle * width) < wanted ? low : high) = middle;
      }
    else
      low = high = (fineness(knot_quality[k]) - x[rung]) / width;
    const auto found = static_cast<float>((low + high) / 2);
    out.push_back(k > 0 && rung == last_rung ? std::max(found, out.back()) : found);
    last_rung = rung;
  }
  return out;
}

double modelled_bytes(const SizeModel& model, double vqp, double quality) {
  if (!has_model(model)) return 0;
  return static_cast<double>(model.a) * portable::exp(quality * log_r(model, vqp));
}

double modelled_quality(const SizeModel& model, double vqp, double bytes) {
  if (!has_model(model) || !(bytes > 0)) return 0;
  return (portable::log(bytes) - portable::log(static_cast<double>(model.a))) / log_r(model, vqp);
}

}  // namespace texmesh
