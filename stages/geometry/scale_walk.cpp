#include "stages/geometry/scale_walk.h"

#include <limits>

namespace texmesh {
namespace {

constexpr int kMostCorners = 4;

}  // namespace

std::vector<std::uint32_t> survivors(std::size_t positions, std::span<const Collapse> collapses,
                                     std::size_t count) {
  std::vector<std::uint32_t> survivor(positions);
  for (std::size_t p = 0; p < positions; ++p) survivor[p] = static_cast<std::uint32_t>(p);
  // Backwards, so that a chain's end is known before the links that lead to it.
  for (std::size_t c = count; c-- > 0;) survivor[collapses[c].from] = survivor[collapses[c].to];
  return survivor;
}

ScaleWalk::ScaleWalk(const Mesh& mesh, const std::vector<Triangle>& triangles,
                     std::span<const std::uint32_t> survivor, const SurfaceDistance& surface)
    : positions_(mesh.positions),
      survivor_(survivor),
      surface_(surface),
      spokes_(mesh.positions.size(), triangles, [&](std::uint32_t w) { return mesh.wedge_position[w]; }) {}

std::uint32_t ScaleWalk::nearest_corner(std::uint32_t from, Vec3d point) const {
  const auto distance2 = [&](std::uint32_t p) {
    const Vec3d d = to_double(positions_[p]) - point;
    return dot(d, d);
  };
  double best = distance2(from);
  for (int walk = 0; walk < kMostCorners; ++walk) {
    std::uint32_t next = from;
    for (const Spokes::Spoke& spoke : spokes_.at(from))
      if (const double d = distance2(spoke.next); d < best) best = d, next = spoke.next;
    if (next == from) break;
    from = next;
  }
  return from;
}

ScaleWalk::Guess ScaleWalk::from(std::uint32_t position, Vec3d point) const {
  Guess best{std::numeric_limits<double>::infinity(), kNoIndex, {}};
  const std::uint32_t at = nearest_corner(survivor_[position], point);
  for (const Spokes::Spoke& spoke : spokes_.at(at)) {
    if (!(best.distance2 > 0)) break;
    if (const double d = surface_.distance2_to(spoke.triangle, point); d < best.distance2)
      best.distance2 = d, best.triangle = spoke.triangle;
  }
  if (best.triangle != kNoIndex) best.hint = surface_.hint_of(best.triangle);
  return best;
}

}  // namespace texmesh
