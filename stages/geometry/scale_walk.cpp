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
      begin_(mesh.positions.size() + 1, 0),
      spoke_(3 * triangles.size()) {
  for (const Triangle& t : triangles)
    for (const std::uint32_t w : t) ++begin_[mesh.wedge_position[w] + 1];
  for (std::size_t p = 1; p < begin_.size(); ++p) begin_[p] += begin_[p - 1];
  std::vector<std::uint32_t> end(begin_.begin(), begin_.end() - 1);
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k)
      spoke_[end[mesh.wedge_position[triangles[t][k]]]++] = {t,
                                                             mesh.wedge_position[triangles[t][(k + 1) % 3]]};
}

std::uint32_t ScaleWalk::nearest_corner(std::uint32_t from, Vec3d point) const {
  const auto distance2 = [&](std::uint32_t p) {
    const Vec3d d = to_double(positions_[p]) - point;
    return dot(d, d);
  };
  double best = distance2(from);
  for (int walk = 0; walk < kMostCorners; ++walk) {
    std::uint32_t next = from;
    for (std::uint32_t i = begin_[from]; i < begin_[from + 1]; ++i)
      if (const double d = distance2(spoke_[i].next); d < best) best = d, next = spoke_[i].next;
    if (next == from) break;
    from = next;
  }
  return from;
}

ScaleWalk::Guess ScaleWalk::from(std::uint32_t position, Vec3d point) const {
  Guess best{std::numeric_limits<double>::infinity(), kNoIndex, {}};
  const std::uint32_t at = nearest_corner(survivor_[position], point);
  for (std::uint32_t i = begin_[at]; i < begin_[at + 1] && best.distance2 > 0; ++i)
    if (const double d = surface_.distance2_to(spoke_[i].triangle, point); d < best.distance2)
      best.distance2 = d, best.triangle = spoke_[i].triangle;
  if (best.triangle != kNoIndex) best.hint = surface_.hint_of(best.triangle);
  return best;
}

}  // namespace texmesh
