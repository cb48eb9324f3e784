// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/skeletonization/contraction_parts.h"

#include <CGAL/Delaunay_triangulation_3.h>
#include <CGAL/Delaunay_triangulation_cell_base_3.h>
#include <CGAL/Exact_predicates_exact_constructions_kernel.h>
#include <CGAL/Triangulation_vertex_base_with_info_3.h>

#include <utility>

namespace texmesh {
namespace {

using Kernel = CGAL::Exact_predicates_exact_constructions_kernel;
using VertexBase = CGAL::Triangulation_vertex_base_with_info_3<std::uint32_t, Kernel>;
using CellBase = CGAL::Delaunay_triangulation_cell_base_3<Kernel>;
using Delaunay =
    CGAL::Delaunay_triangulation_3<Kernel, CGAL::Triangulation_data_structure_3<VertexBase, CellBase>>;

}  // namespace

std::vector<Vec3d> voronoi_poles(const std::vector<Vec3d>& points, const std::vector<Vec3d>& normals) {
  std::vector<std::pair<Kernel::Point_3, std::uint32_t>> sites;
  for (const Vec3d& p : points)
    sites.emplace_back(Kernel::Point_3(p.x, p.y, p.z), static_cast<std::uint32_t>(sites.size()));
  const Delaunay triangulation(sites.begin(), sites.end());

  std::vector<Vec3d> corners;
  std::vector<std::vector<std::uint32_t>> corners_of(points.size());
  for (auto cell = triangulation.finite_cells_begin(); cell != triangulation.finite_cells_end(); ++cell) {
    const Kernel::Point_3 dual = triangulation.dual(cell);
    for (int i = 0; i < 4; ++i)
      corners_of[cell->vertex(i)->info()].push_back(static_cast<std::uint32_t>(corners.size()));
    corners.push_back({CGAL::to_double(dual.x()), CGAL::to_double(dual.y()), CGAL::to_double(dual.z())});
  }

  std::vector<Vec3d> poles(points.size());
  std::vector<std::uint32_t> without;
  for (std::uint32_t p = 0; p < points.size(); ++p) {
    double least = 0;
    std::uint32_t farthest = kNoIndex;
    for (const std::uint32_t c : corners_of[p])
      if (const double t = dot(corners[c] - points[p], normals[p]); t < least) {
        farthest = c;
        least = t;
      }
    if (farthest == kNoIndex)
      without.push_back(p);
    else
      poles[p] = corners[farthest];
  }
  for (const std::uint32_t p : without) {
    Delaunay::Locate_type type{};
    int i = 0, j = 0;
    const auto cell = triangulation.locate(sites[p].first, type, i, j);
    CGAL_assertion(type == Delaunay::VERTEX);
    poles[p] = poles[cell->vertex(i)->info()];
  }
  return poles;
}

}  // namespace texmesh
