#pragma once
#include <cstddef>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/skeletonization/triangle_soup.h"

namespace texmesh {

/// The alpha wrap of a triangle soup (Portaneri et al. 2022, CGAL): closed oriented 2-manifolds around it
/// that enter no hole narrower than alpha, at a distance of about `offset`, decimated to `max_faces`; one
/// soup for each connected part, every point in use. The wrap shrinks step by step (about 10 per face that
/// comes out). CGAL promises no end for an offset that is tiny beside alpha, so a wrap is given up after
/// `max_steps`, and when the steps have looked at 50 * max_steps triangles of the soup. Distances and
/// overlaps are in plain double arithmetic (triangle_tree.h). Stops when cancelled. GeometryFailure where it
/// is given up and where a check of CGAL fails. Deterministic, single-threaded.
std::vector<TriangleSoup> wrap_surface(const TriangleSoup& soup, double alpha, double offset,
                                       std::size_t max_faces, std::size_t max_steps,
                                       const RunContext& context);

}  // namespace texmesh
