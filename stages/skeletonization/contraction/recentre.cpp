#include "stages/skeletonization/contraction/recentre.h"

#include <cstdint>
#include <vector>

namespace texmesh {
namespace {

/// A node has the poles of a few points, and poles of a wrap's flat faces scatter. The worst R of three
/// cylinders and three tori is off by 0.8 and 2.6 %; with 3 rounds by 1.0 and 2.8 %, with 40 by 1.7 and 2.6
/// %, and where nothing is recentred by 0.5 and 6.7 %.
constexpr int kSmoothingRounds = 16;

std::vector<NodePoles> smoothed(const CurveSkeleton& curve, std::vector<NodePoles> pull) {
  for (int round = 0; round < kSmoothingRounds; ++round) {
    std::vector<NodePoles> next = pull;
    const auto add = [&](std::uint32_t to, std::uint32_t from) {
      next[to].sum = next[to].sum + pull[from].sum;
      next[to].count += pull[from].count;
    };
    for (const auto& [a, b] : curve.segments) add(a, b), add(b, a);
    pull = std::move(next);
  }
  return pull;
}

/// Directions along which nodes must not move; of length 0 where there is none.
std::vector<Vec3d> directions_along(const CurveSkeleton& curve) {
  std::vector<Vec3d> along(curve.nodes.size());
  std::vector<std::uint32_t> degree(curve.nodes.size(), 0);
  for (const auto& [a, b] : curve.segments) {
    const Vec3d way = curve.nodes[b] - curve.nodes[a];
    // Towards the second neighbour and away from the first one.
    along[a] = degree[a]++ == 0 ? way : way - along[a];
    along[b] = degree[b]++ == 0 ? way * -1 : way * -1 - along[b];
  }
  for (std::size_t n = 0; n < along.size(); ++n) {
    const double size = length(along[n]);
    along[n] = degree[n] > 2 || !(size > 0) ? Vec3d{} : along[n] * (1 / size);
  }
  return along;
}

}  // namespace

void recentre(CurveSkeleton& curve, std::span<const NodePoles> poles) {
  std::vector<NodePoles> pull(poles.begin(), poles.end());
  for (std::size_t n = 0; n < pull.size(); ++n) pull[n].sum = pull[n].sum - curve.nodes[n] * pull[n].count;
  pull = smoothed(curve, std::move(pull));
  const std::vector<Vec3d> along = directions_along(curve);
  for (std::size_t n = 0; n < pull.size(); ++n) {
    if (!(pull[n].count > 0)) continue;
    const Vec3d move = pull[n].sum * (1 / pull[n].count);
    curve.nodes[n] = curve.nodes[n] + move - along[n] * dot(move, along[n]);
  }
}

}  // namespace texmesh
