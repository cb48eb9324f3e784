#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "stages/skeletonization/triangle_soup.h"

namespace texmesh {

/// Line segments between nodes.
struct CurveSkeleton {
  std::vector<Vec3d> nodes;
  std::vector<std::array<std::uint32_t, 2>> segments;
};

/// The mean curvature flow skeleton (Tagliasacchi et al. 2012, CGAL's defaults) of one connected closed
/// oriented 2-manifold, contracted at most `max_contractions` times and then recentred (recentre.h). CGAL's
/// test whether a point is inside tries one random ray after the other until one misses every edge, which
/// never happens on surfaces that lie on themselves (known upstream): after 1,000 rays from one point the
/// contraction is given up. GeometryFailure for a surface that is not closed, where the contraction is given
/// up, and where a check of CGAL fails. Deterministic, single-threaded.
CurveSkeleton contract_to_skeleton(const TriangleSoup& closed, int max_contractions = 500);

}  // namespace texmesh
