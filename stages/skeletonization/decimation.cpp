// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/skeletonization/wrap.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Edge_length_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Midpoint_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <CGAL/Uncertain.h>
#include <CGAL/exceptions.h>

namespace texmesh {
namespace {

namespace simplification = CGAL::Surface_mesh_simplification;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

/// The order of vertices, faces and half-edges decides which of two equal collapses comes first.
SurfaceMesh surface_mesh(const TriangleSoup& soup) {
  SurfaceMesh mesh;
  for (const Vec3d& p : soup.points) mesh.add_vertex({p.x, p.y, p.z});
  using Vertex = SurfaceMesh::Vertex_index;
  for (const Triangle& t : soup.triangles)
    CGAL::Euler::add_face(std::array{Vertex(t[0]), Vertex(t[1]), Vertex(t[2])}, mesh);
  return mesh;
}

TriangleSoup triangle_soup(const SurfaceMesh& mesh) {
  TriangleSoup soup;
  for (const auto v : mesh.vertices())
    soup.points.push_back({mesh.point(v).x(), mesh.point(v).y(), mesh.point(v).z()});
  for (const auto face : mesh.faces()) {
    Triangle& triangle = soup.triangles.emplace_back();
    std::size_t k = 0;
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(face))) triangle[k++] = v;
  }
  return soup;
}

/// `collapse` takes edges out of a mesh until a predicate stops it.
TriangleSoup collapsed(TriangleSoup closed, std::size_t max_faces, auto&& collapse) {
  if (closed.triangles.size() <= max_faces) return closed;
  return with_cgal_checks([&] {
    SurfaceMesh mesh = surface_mesh(closed);
    // A closed triangle mesh has three edges for two faces.
    collapse(mesh, simplification::Count_stop_predicate<SurfaceMesh>(max_faces * 3 / 2));
    mesh.collect_garbage();
    return triangle_soup(mesh);
  });
}

}  // namespace

void rethrow_cgal_failure() {
  try {
    throw;
  } catch (const CGAL::Failure_exception& e) {
    throw GeometryFailure(e.what());
  } catch (const CGAL::Uncertain_conversion_exception& e) {
    throw GeometryFailure(e.what());
  }
}

TriangleSoup decimate(TriangleSoup closed, std::size_t max_faces) {
  return collapsed(std::move(closed), max_faces,
                   [](SurfaceMesh& mesh, const auto& stop) { simplification::edge_collapse(mesh, stop); });
}

TriangleSoup decimate_evenly(TriangleSoup closed, std::size_t max_faces) {
  return collapsed(std::move(closed), max_faces, [](SurfaceMesh& mesh, const auto& stop) {
    simplification::edge_collapse(mesh, stop,
                                  CGAL::parameters::get_cost(simplification::Edge_length_cost<SurfaceMesh>())
                                      .get_placement(simplification::Midpoint_placement<SurfaceMesh>()));
  });
}

}  // namespace texmesh
