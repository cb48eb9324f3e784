#pragma once
#include <span>

#include "stages/data/nested_scales.h"
#include "stages/data/skeleton.h"
#include "tools/inspect/pictures/painted_quantity.h"

namespace texmesh {

// Results of the method's stages as something to look at.

/// The curve skeleton as lines inside the shape.
PaintedModel paint_skeleton(const ConditionedMesh& mesh, const Skeleton& skeleton);
/// R(v), the distance to the skeleton. StageError where the skeleton is of another mesh.
PaintedModel paint_radius(const ConditionedMesh& mesh, const Skeleton& skeleton);
/// At which error a vertex was removed; logarithmic.
PaintedModel paint_collapse_error(const NestedScales& scales);
/// skeleton, R, collapse-error.
std::span<const PaintedQuantity> laboratory_quantities();

}  // namespace texmesh
