#pragma once
#include "stages/base/run_context.h"
#include "stages/skeletonization/triangle_soup.h"

namespace texmesh {

/// The alpha wrap of wrap.h before it is decimated: one soup, closed, oriented outwards, every point in use.
/// GeometryFailure as there. Deterministic, single-threaded.
TriangleSoup alpha_wrap(const TriangleSoup& soup, double alpha, double offset, std::size_t max_steps,
                        const RunContext& context);

}  // namespace texmesh
