#pragma once
#include "stages/geometry/triangle_tree.h"
#include "stages/skeletonization/wrap.h"

namespace texmesh {

struct LocalRadiusOptions {
  double plate_ratio = 5;  // a part whose median skeleton distance / half thickness is above it is a plate
  double limb_ratio = 3;   // elsewhere R is at most this many half thicknesses
  double offset = 0;       // how far the wrap stands off the shape
};

struct LocalRadius {
  std::vector<double> radius;  // R, per point
  std::size_t parts = 0, plates = 0;
  std::size_t limited = 0;  // points whose skeleton distance the thickness has lowered
};

/// The skeleton distance, corrected by the local thickness of the wrap where a curve cannot be a skeleton.
/// - On plates, whose medial shape is a sheet, R is half the thickness.
/// - On extremities that the contraction has swallowed, R is at most limb_ratio half thicknesses.
/// - Where the wrap's walls are little farther apart than its own offsets, it runs around a sheet and tells
///   nothing of a shape: the skeleton distance stays. Between half an offset and one and a half the two are
///   blended. `parts` are the wrap's; `points` and `distance` are what R is asked for, in the same frame.
///   Same bits for any thread count.
LocalRadius limit_by_thickness(const std::vector<TriangleSoup>& parts, std::span<const Vec3d> points,
                               std::span<const double> distance, const LocalRadiusOptions& options,
                               const RunContext& context);

/// Half the local thickness of a solid at the points of its surface (the shape diameter function, Shapira et
/// al. 2008). From every triangle rays go inwards in a cone. The median of how far they get, measured along
/// the normal, is halved: exact between parallel walls, 0.8 of a ball's radius. The triangles' values are
/// filtered twice by the median over the neighbours and averaged to the points. A ray that leaves the solid
/// nowhere counts as missed; a point all of whose rays miss gets infinity. `closed`: closed oriented triangle
/// meshes, normals outwards; `tree`: a TriangleTree over them. Same bytes for any thread count.
std::vector<double> half_thickness(const TriangleSoup& closed, const TriangleTree& tree,
                                   const RunContext& context);

}  // namespace texmesh
