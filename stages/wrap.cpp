// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/wrap.h"

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_ratio_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <CGAL/alpha_wrap_3.h>

#include <array>
#include <stdexcept>
#include <string>

namespace texmesh {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using SurfaceMesh = CGAL::Surface_mesh<Point>;
using PartMap = SurfaceMesh::Property_map<SurfaceMesh::Face_index, std::size_t>;

/// Counts the steps of the wrapping; CGAL calls it before each.
class StepCounter : public CGAL::Alpha_wraps_3::internal::Wrapping_default_visitor {
 public:
  explicit StepCounter(std::size_t most) : left_(most) {}
  template <class Wrapper, class Gate>
  void before_facet_treatment(const Wrapper&, const Gate&) {
    if (left_-- == 0) throw std::runtime_error("the wrap takes too many steps");
  }

 private:
  std::size_t left_;
};

void decimate(SurfaceMesh& wrap, std::size_t max_faces) {
  if (wrap.number_of_faces() <= max_faces) return;
  // A closed triangle mesh has three edges for two faces.
  CGAL::Surface_mesh_simplification::Count_stop_predicate<SurfaceMesh> stop(max_faces * 3 / 2);
  CGAL::Surface_mesh_simplification::edge_collapse(wrap, stop);
  wrap.collect_garbage();
}

std::vector<TriangleSoup> split_parts(SurfaceMesh& wrap) {
  const PartMap part = wrap.add_property_map<SurfaceMesh::Face_index, std::size_t>("f:part", 0).first;
  std::vector<TriangleSoup> parts(CGAL::Polygon_mesh_processing::connected_components(wrap, part));
  std::vector<std::uint32_t> number(wrap.number_of_vertices(), 0xffffffffu);
  for (const auto face : wrap.faces()) {
    TriangleSoup& to = parts[part[face]];
    Triangle triangle{};
    std::size_t k = 0;
    for (const auto v : wrap.vertices_around_face(wrap.halfedge(face))) {
      if (number[v] == 0xffffffffu) {
        number[v] = static_cast<std::uint32_t>(to.points.size());
        to.points.push_back({wrap.point(v).x(), wrap.point(v).y(), wrap.point(v).z()});
      }
      triangle[k++] = number[v];
    }
    to.triangles.push_back(triangle);
  }
  return parts;
}

}  // namespace

std::vector<TriangleSoup> wrap_surface(const TriangleSoup& soup, double alpha, double offset,
                                       std::size_t max_faces, std::size_t max_steps) {
  std::vector<Point> points;
  points.reserve(soup.points.size());
  for (const Vec3d& p : soup.points) points.emplace_back(p.x, p.y, p.z);
  std::vector<std::array<std::size_t, 3>> triangles;
  triangles.reserve(soup.triangles.size());
  for (const Triangle& t : soup.triangles) triangles.push_back({t[0], t[1], t[2]});
  SurfaceMesh wrap;
  StepCounter counter(max_steps);
  CGAL::alpha_wrap_3(points, triangles, alpha, offset, wrap, CGAL::parameters::default_values(),
                     CGAL::parameters::visitor(std::ref(counter)));
  decimate(wrap, max_faces);
  return split_parts(wrap);
}

}  // namespace texmesh
