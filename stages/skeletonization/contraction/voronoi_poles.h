#pragma once
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Per point of a closed surface, the corner of its Voronoi cell that lies farthest inside, against its
/// outward normal (Amenta and Bern 1999). A point that shares its place with another has that one's pole, and
/// a point with no corner inside has the origin. Corners are computed exactly and then rounded. Sizes of
/// `points` and `normals` are equal. Deterministic, single-threaded.
std::vector<Vec3d> voronoi_poles(const std::vector<Vec3d>& points, const std::vector<Vec3d>& normals);

}  // namespace texmesh
