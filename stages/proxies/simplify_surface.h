#pragma once
// Inside the room only: coarse surfaces of a model.
#include "stages/charts/charts.h"

namespace texmesh {

/// Coarse surfaces of a triangle soup, by collapses of edges to the place of least quadric error (Garland and
/// Heckbert 1997). Topology may change: there is no link condition, and what is too small to be seen
/// vanishes.
///
/// `positions`: finite or not, object units; equal ones are welded. `triangles`: three position indices each;
/// those with equal, non-finite or missing corners are dropped. `group`: per triangle, or empty for one
/// group; outlines of groups are held as borders are. `triangle_counts`: how many triangles to have at most,
/// in falling order, each >= 1.
///
/// Returns one surface per count, from one run. A surface has no triangle only when the soup has none with an
/// area. Same bytes on every machine, for any number of threads. Time O(n log n), memory about 200 bytes per
/// triangle. Throws Cancelled.
std::vector<ProxySurface> simplify_surface(std::span<const Vec3f> positions,
                                           std::span<const Triangle> triangles,
                                           std::span<const std::uint32_t> group,
                                           std::span<const std::uint32_t> triangle_counts,
                                           const RunContext& context);

}  // namespace texmesh
