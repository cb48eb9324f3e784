#pragma once
#include "stages/data/conditioned_mesh.h"
#include "stages/skeletonization/triangle_soup.h"

namespace texmesh {

/// The frame in which wrap and contraction work: centred, diagonal 1.
struct UnitFrame {
  Vec3d centre;
  double diagonal = 0;
  Vec3d to_unit(Vec3f p) const { return (to_double(p) - centre) * (1 / diagonal); }
  Vec3d from_unit(Vec3d p) const { return p * diagonal + centre; }
};
UnitFrame unit_frame_of(const std::vector<Vec3f>& positions);

/// What is wrapped of a mesh, in the unit frame: the triangles that have an area, clustered to 100,000 when
/// there are more (a wrap looks at nothing finer than its alpha), every point in use. Holes are closed by
/// fans around their middle where that adds less than a quarter to the component's area, so that a bust that
/// is open at its base is wrapped as a solid, not as a bowl; a sheet stays a sheet. GeometryFailure when no
/// triangle has an area. Deterministic.
TriangleSoup make_wrap_soup(const ConditionedMesh& mesh, const UnitFrame& frame);

}  // namespace texmesh
