#pragma once
// Inside the ladder only.
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// Mean absolute difference of 8-bit samples between the plane's last rung and `pixels`, over the covered
/// texels of up to 16 stored fragments, evenly spread in index order; 0 when nothing is stored.
double source_difference(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder);

}  // namespace texmesh
