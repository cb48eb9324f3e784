#pragma once
#include "stages/data/nested_scales.h"

namespace texmesh {

/// What stands for S_0 where small pictures are all that is asked for: the index of the finest scale of at
/// most so many triangles. A finer one where scales are missing in between or are farther (root mean square)
/// from S_0 than `farthest`, object units; 0, S_0 itself, for meshes that have no more.
std::size_t stand_in_scale(const NestedScales& scales, std::size_t most_triangles, double farthest);

}  // namespace texmesh
