#pragma once
// Inside the room only: the closed surface around a mesh that is contracted to the skeleton.
#include <cstddef>

#include "stages/base/run_context.h"
#include "stages/data/conditioned_mesh.h"

namespace texmesh {

/// Points and triangles over them; nothing else is promised.
struct TriangleSoup {
  std::vector<Vec3d> points;
  std::vector<Triangle> triangles;
};

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

/// The alpha wrap of wrap_surface() before it is decimated: one soup, closed, oriented outwards, every point
/// in use. GeometryFailure as there. Deterministic, single-threaded.
TriangleSoup alpha_wrap(const TriangleSoup& soup, double alpha, double offset, std::size_t max_steps,
                        const RunContext& context);

/// A closed oriented 2-manifold of at most about `max_faces` faces (edge collapses, Lindstrom and Turk 1998,
/// CGAL's defaults); the soup itself when it has no more. GeometryFailure where a check of CGAL fails.
/// Deterministic, single-threaded.
TriangleSoup decimate(TriangleSoup closed, std::size_t max_faces);

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
