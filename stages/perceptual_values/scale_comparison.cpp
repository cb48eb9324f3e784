#include "stages/perceptual_values/scale_comparison.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <utility>

namespace texmesh {

ScaleComparison::ScaleComparison(const Mesh& mesh, const NestedScale& scale,
                                 std::span<const std::uint32_t> survivor)
    : surface_(mesh.positions, mesh.wedge_position, scale.triangles),
      walk_(mesh, scale.triangles, survivor, surface_) {}

std::vector<double> ScaleComparison::largest(std::span<const ScalePoint> points, std::size_t count,
                                             bool relative) const {
  struct Candidate {
    double most;
    std::uint32_t point;
    SurfaceDistance::Hint hint;
    bool operator<(const Candidate& o) const { return most < o.most || (most == o.most && point < o.point); }
  };
  const auto divisor = [&](std::uint32_t p) { return relative ? points[p].radius : 1; };
  std::vector<Candidate> candidates;
  candidates.reserve(points.size());
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    const ScaleWalk::Guess guess = walk_.from(points[p].position, points[p].at);
    candidates.push_back({std::sqrt(guess.distance2) / divisor(p), p, guess.hint});
  }
  std::make_heap(candidates.begin(), candidates.end());
  count = std::min(count, points.size());
  std::vector<double> found;  // a heap, the least on top
  while (!candidates.empty() && (found.size() < count || candidates.front().most > found.front())) {
    std::pop_heap(candidates.begin(), candidates.end());
    auto [most, p, hint] = candidates.back();
    candidates.pop_back();
    found.push_back(surface_(points[p].at, hint) / divisor(p));
    std::push_heap(found.begin(), found.end(), std::greater<>());
    if (found.size() <= count) continue;
    std::pop_heap(found.begin(), found.end(), std::greater<>());
    found.pop_back();
  }
  std::sort(found.begin(), found.end(), std::greater<>());
  return found;
}

}  // namespace texmesh
