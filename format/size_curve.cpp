#include <algorithm>

#include "format/portable_math.h"
#include "format/tables.h"

namespace texmesh {
namespace {

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

}  // namespace

double interpolated_bytes(const PlaneTables& tables, std::size_t fragment, double quality) {
  std::vector<double> x, y;  // g, ln bytes
  for (std::size_t r = 0; r < tables.rung_count(); ++r) {
    const auto bytes = static_cast<double>(bytes_to_show(tables, r, fragment));
    if (bytes <= 0) continue;
    if (quality == static_cast<double>(tables.rung_quality[r])) return bytes;
    x.push_back(log_quantiser(tables.rung_quality[r]));
    y.push_back(portable::log(bytes));
  }
  if (x.empty()) return 0;
  const double at = log_quantiser(quality);
  if (at <= x.front()) return portable::exp(y.front());
  if (at >= x.back()) return portable::exp(y.back());
  const auto k = static_cast<std::size_t>(std::upper_bound(x.begin(), x.end(), at) - x.begin()) - 1;
  return portable::exp(hermite(x, y, k, at));
}

}  // namespace texmesh
