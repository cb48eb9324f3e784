#pragma once
#include <array>
#include <cstdint>
#include <vector>

#include "stages/wrap.h"

namespace texmesh {

/// Line segments between nodes.
struct CurveSkeleton {
  std::vector<Vec3d> nodes;
  std::vector<std::array<std::uint32_t, 2>> segments;
};

/// The mean curvature flow skeleton (Tagliasacchi et al. 2012, CGAL's defaults) of one connected closed
/// oriented 2-manifold. Throws whatever CGAL throws, and std::runtime_error for a surface that is not closed.
/// Deterministic, single-threaded.
CurveSkeleton contract_to_skeleton(const TriangleSoup& closed);

}  // namespace texmesh
