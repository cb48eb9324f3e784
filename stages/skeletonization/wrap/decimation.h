#pragma once
#include <cstddef>

#include "stages/skeletonization/triangle_soup.h"

namespace texmesh {

/// A closed oriented 2-manifold of at most about `max_faces` faces (edge collapses, Lindstrom and Turk 1998,
/// CGAL's defaults); the soup itself when it has no more. GeometryFailure where a check of CGAL fails.
/// Deterministic, single-threaded.
TriangleSoup decimate(TriangleSoup closed, std::size_t max_faces);

}  // namespace texmesh
