#pragma once
#include "stages/base/run_context.h"
#include "stages/data/nested_scales.h"

namespace texmesh {

/// Fills error_max, error_rms and deviation of all scales but the first, S_0: distances of 500 to 4,000
/// points spread over S_0 to S_i and over S_i to S_0, and, for the largest, of S_0's vertices. `component`:
/// per position. Each scale takes time linear in S_0's positions, collapses and the scale's triangles, plus a
/// fixed number of distances.
void measure_scale_errors(const std::vector<std::uint32_t>& component, NestedScales& scales,
                          const RunContext& context);

}  // namespace texmesh
