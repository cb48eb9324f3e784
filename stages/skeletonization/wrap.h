#pragma once
// Inside the room only: the closed surface, of a mesh or around it, that is contracted to the skeleton.
#include <exception>

#include "stages/base/run_context.h"
#include "stages/data/conditioned_mesh.h"

namespace texmesh {

/// A surface cannot be wrapped or contracted: CGAL's checks failed on it, or it costs more than a bound
/// allows. The next simpler way may still work.
struct GeometryFailure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// Runs `attempt`, and `fallback` where it throws a GeometryFailure. All other exceptions pass through: a
/// lack of memory is a limit of the machine that must not decide about the result, and our own mistakes are
/// no property of the geometry.
template <class Attempt, class Fallback>
void try_geometry(Attempt&& attempt, Fallback&& fallback) {
  try {
    std::forward<Attempt>(attempt)();
  } catch (const GeometryFailure&) {
    std::forward<Fallback>(fallback)();
  }
}

/// Called in a handler: throws a GeometryFailure where the exception in flight is a failed check of CGAL, and
/// the exception itself where it is another one.
[[noreturn]] void rethrow_cgal_failure();

/// Runs `work`, a call into CGAL, whose failed checks become GeometryFailure. CGAL derives them from
/// std::logic_error: nothing above could tell them from our own mistakes.
template <class Work>
auto with_cgal_checks(Work&& work) {
  try {
    return std::forward<Work>(work)();
  } catch (const std::exception&) {
    rethrow_cgal_failure();
  }
}

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

/// The same by the shortest edges, each to its middle: no triangle gets long, as decimate() makes them along
/// cylinders, whose contraction then misses the middle.
TriangleSoup decimate_evenly(TriangleSoup closed, std::size_t max_faces);

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

/// Whether a soup is one connected closed surface around a solid: each edge has two triangles, which run
/// against each other along it, their normals look outwards, and no edge is longer than `longest`. Parts of
/// it may still lie in each other.
bool is_closed_surface(const TriangleSoup& soup, double longest);

}  // namespace texmesh
