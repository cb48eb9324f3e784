#pragma once
#include <vector>

#include "stages/base/run_context.h"
#include "stages/geometry/triangle_tree.h"
#include "stages/skeletonization/wrap/wrap.h"

namespace texmesh {

/// Half the local thickness of a solid at the points of its surface (the shape diameter function, Shapira et
/// al. 2008). From every triangle rays go inwards in a cone. The median of how far they get, measured along
/// the normal, is halved: exact between parallel walls, 0.8 of a ball's radius. The triangles' values are
/// filtered twice by the median over the neighbours and averaged to the points. A ray that leaves the solid
/// nowhere counts as missed; a point all of whose rays miss gets infinity. `closed`: closed oriented triangle
/// meshes, normals outwards; `tree`: a TriangleTree over them. Same bytes for any thread count.
std::vector<double> half_thickness(const TriangleSoup& closed, const TriangleTree& tree,
                                   const RunContext& context);

}  // namespace texmesh
