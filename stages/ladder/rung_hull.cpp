#include "stages/ladder/rung_hull.h"

#include <algorithm>
#include <limits>
#include <numeric>

namespace texmesh {
namespace {

struct HullPoint {
  std::uint64_t bytes = 0;
  double loss = 0;
  bool fixed = false;  // is not taken off the hull, however little the hull gains by it
};

/// Lower convex hull of (bytes, loss), where loss falls; indices by rising bytes.
std::vector<std::size_t> hull_of(const std::vector<HullPoint>& points) {
  std::vector<std::size_t> order(points.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) {
    if (points[a].bytes != points[b].bytes) return points[a].bytes < points[b].bytes;
    if (points[a].loss != points[b].loss) return points[a].loss < points[b].loss;
    return a < b;
  });
  const auto slope = [&](std::size_t a, std::size_t b) {
    return (points[b].loss - points[a].loss) / static_cast<double>(points[b].bytes - points[a].bytes);
  };
  std::vector<std::size_t> hull;
  for (const std::size_t k : order) {
    if (!hull.empty() && (points[k].loss >= points[hull.back()].loss)) continue;
    while (hull.size() > 1 && slope(hull[hull.size() - 2], hull.back()) >= slope(hull.back(), k))
      hull.pop_back();
    hull.push_back(k);
  }
  return hull;
}

/// The hull's loss at so many bytes.
double hull_loss(const std::vector<HullPoint>& points, const std::vector<std::size_t>& hull,
                 std::uint64_t bytes) {
  for (std::size_t k = 1; k < hull.size(); ++k) {
    const HullPoint &a = points[hull[k - 1]], &b = points[hull[k]];
    if (bytes > b.bytes) continue;
    if (bytes == b.bytes) return b.loss;  // interpolation would miss it by rounding
    return a.loss + (b.loss - a.loss) *
                        (static_cast<double>(bytes - a.bytes) / static_cast<double>(b.bytes - a.bytes));
  }
  return points[hull.back()].loss;
}

/// The hull without the vertices that are not fixed and without which it hardly rises.
std::vector<std::size_t> thinned(const std::vector<HullPoint>& points, double gain,
                                 std::vector<std::size_t> hull) {
  for (;;) {
    std::size_t least = 0;
    double least_rise = gain;
    for (std::size_t k = 1; k + 1 < hull.size(); ++k) {
      const HullPoint& point = points[hull[k]];
      if (point.fixed || point.loss <= 0) continue;
      const double rise = hull_loss(points, {hull[k - 1], hull[k + 1]}, point.bytes) / point.loss - 1;
      if (rise < least_rise || (rise == least_rise && least == 0)) least = k, least_rise = rise;
    }
    if (least == 0) return hull;
    hull.erase(hull.begin() + static_cast<std::ptrdiff_t>(least));
  }
}

/// The level's pair whose loss is the least multiple of the hull's.
std::size_t nearest_of_level(const std::vector<RungPair>& pairs, const std::vector<HullPoint>& points,
                             const std::vector<std::size_t>& hull, std::size_t level) {
  std::size_t nearest = pairs.size();
  double least = 0;
  for (std::size_t k = 0; k < pairs.size(); ++k) {
    if (pairs[k].level != level) continue;
    const double best = hull_loss(points, hull, pairs[k].bytes);
    const double excess = pairs[k].loss <= best ? 1
                          : best > 0            ? pairs[k].loss / best
                                                : std::numeric_limits<double>::infinity();
    if (nearest == pairs.size() || excess < least) nearest = k, least = excess;
  }
  return nearest;
}

}  // namespace

std::vector<std::uint8_t> worth_storing(const std::vector<RungPair>& pairs, double gain) {
  std::vector<std::uint8_t> keep(pairs.size(), gain < 0);
  if (pairs.empty() || gain < 0) return keep;
  std::vector<HullPoint> points;
  std::size_t levels = 0;
  for (const RungPair& pair : pairs) {
    points.push_back({pair.bytes, pair.loss, pair.level == 0});
    levels = std::max(levels, pair.level + 1);
  }
  const std::vector<std::size_t> hull = hull_of(points);
  for (const std::size_t k : thinned(points, gain, hull)) keep[k] = 1;
  for (std::size_t level = 0; level < levels; ++level) {
    bool any = false;
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      if (pairs[k].level != level) continue;
      if (level == 0) keep[k] = 1;
      any = any || keep[k];
    }
    const std::size_t nearest = any ? pairs.size() : nearest_of_level(pairs, points, hull, level);
    if (nearest < pairs.size()) keep[nearest] = 1;
  }
  return keep;
}

std::vector<std::uint8_t> keep_for_display(const std::vector<MipChoice>& choices, double shown_well,
                                           double gain, std::vector<std::uint8_t> keep) {
  if (choices.size() < 2) return keep;
  std::size_t top = 1;
  while (top + 1 < choices.size() && choices[top].loss > shown_well) ++top;
  for (std::size_t k = 1; k < choices.size(); ++k)
    if (choices[k].loss >= choices[0].loss && k != top) keep[k - 1] = 0;
  std::vector<HullPoint> points;
  for (std::size_t k = 0; k <= top; ++k)
    points.push_back({choices[k].bytes, choices[k].loss, k == 0 || keep[k - 1] != 0});
  for (const std::size_t k : thinned(points, gain, hull_of(points)))
    if (k > 0) keep[k - 1] = 1;
  keep[top - 1] = 1;
  return keep;
}

}  // namespace texmesh
