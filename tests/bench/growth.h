#pragma once
#include <cmath>
#include <cstddef>
#include <vector>

namespace texmesh {

/// Slope of the least-squares line through (log size, log time): how time grows with size. 0 below two
/// points.
inline double growth_exponent(const std::vector<double>& sizes, const std::vector<double>& times_s) {
  const double n = static_cast<double>(sizes.size());
  double mx = 0, my = 0, xy = 0, xx = 0;
  for (std::size_t i = 0; i < sizes.size(); ++i) mx += std::log(sizes[i]) / n, my += std::log(times_s[i]) / n;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    const double x = std::log(sizes[i]) - mx;
    xy += x * (std::log(times_s[i]) - my);
    xx += x * x;
  }
  return xx > 0 ? xy / xx : 0;
}

}  // namespace texmesh
