// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/skeletonization/wrap.h"

#include <CGAL/Alpha_wrap_3/internal/Alpha_wrap_3.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>

#include <unordered_map>

#include "stages/geometry/triangle_tree.h"

namespace texmesh {
namespace {

namespace aw3 = CGAL::Alpha_wraps_3::internal;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;

Vec3d vec(const Point& p) { return {p.x(), p.y(), p.z()}; }

/// What a wrap may cost. Steps are CGAL's, and all together may look at 50 triangles for each of the most
/// steps: where thousands of needles meet, every query meets all of them, and a cone of 5,000 took minutes of
/// few steps. Scans take 25,000 to 100,000 steps and 1 to 4 million triangles.
class WorkCap {
 public:
  WorkCap(std::size_t steps, const RunContext& context)
      : steps_(steps), triangles_(steps * kTrianglesPerStep), context_(context) {}

  void count_step() {
    context_.check_cancelled();
    if (steps_-- == 0 || tried > triangles_) throw GeometryFailure("the wrap takes too many steps");
  }

  std::uint64_t tried = 0;

 private:
  static constexpr std::size_t kTrianglesPerStep = 50;
  std::size_t steps_;
  std::uint64_t triangles_;
  const RunContext& context_;
};

/// CGAL calls it before each step.
class StepCounter : public aw3::Wrapping_default_visitor {
 public:
  explicit StepCounter(WorkCap& cap) : cap_(cap) {}
  void before_facet_treatment(const auto&, const auto&) { cap_.count_step(); }

 private:
  WorkCap& cap_;
};

/// What the wrapping asks of its input. CGAL's own oracle answers with exact predicates; in plain double
/// arithmetic a wrap takes a sixth of the time, and a cell that touches the input by a rounding error does
/// not matter at an offset of 1/600.
class SoupOracle {
 public:
  using Geom_traits = aw3::Alpha_wrap_AABB_traits<Kernel>;

  SoupOracle(const TriangleSoup& soup, WorkCap& cap)
      : soup_(soup), tree_(soup.points, soup.triangles), cap_(cap) {}

  const Geom_traits& geom_traits() const { return traits_; }
  CGAL::Bbox_3 bbox() const {
    const auto& [min, max] = tree_.box();
    return {min.x, min.y, min.z, max.x, max.y, max.z};
  }

  template <class K>
  bool do_intersect(const aw3::Tetrahedron_with_outside_info<K>& cell) const {
    return tree_.meets(
        Tetrahedron({vec(cell.m_tet[0]), vec(cell.m_tet[1]), vec(cell.m_tet[2]), vec(cell.m_tet[3])}),
        cap_.tried);
  }
  template <class K>
  bool do_intersect(const aw3::Ball_3<K>& ball) const {
    const double radius2 = ball.boundary().squared_radius();
    return tree_.distance2(vec(ball.boundary().center()), std::nextafter(radius2, 2 * radius2), cap_.tried) <=
           radius2;
  }

  double squared_distance(const Point& p) const { return tree_.distance2(vec(p), kInfinity, cap_.tried); }
  Point closest_point(const Point& p) const {
    const TriangleTree::Nearest at = tree_.nearest(vec(p), cap_.tried);
    Vec3d on;
    for (std::size_t k = 0; k < 3; ++k)
      on = on + soup_.points[soup_.triangles[at.triangle][k]] * at.weight[k];
    return {on.x, on.y, on.z};
  }

  /// The first point of a segment that is `offset` away from the input, within 1 % of it.
  bool first_intersection(const Point& from, const Point& to, Point& found, double offset) const {
    const auto distance = [this](const Point& p) { return std::sqrt(squared_distance(p)); };
    return aw3::Offset_intersection<Geom_traits, decltype(distance)>(distance, offset, 0.01 * offset, 1)
        .first_intersection(from, to, found);
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();

  const TriangleSoup& soup_;
  TriangleTree tree_;
  WorkCap& cap_;
  Geom_traits traits_;
};

using Wrapper = aw3::Alpha_wrap_3<SoupOracle>;

}  // namespace
}  // namespace texmesh

namespace CGAL::Alpha_wraps_3::internal {

/// The steps of CGAL's own, whose output is a mesh of CGAL with its orientation tested: two thirds of what
/// this file took to compile. Seen from outside, the corners of a facet of an outside cell run
/// counter-clockwise.
template <>
template <>
void texmesh::Wrapper::operator()(const double alpha, const double offset, texmesh::TriangleSoup& wrap,
                                  const texmesh::StepCounter& counter) {
  texmesh::StepCounter visitor = counter;
  if (!initialize(alpha, offset, std::vector<Point_3>())) return;
  alpha_flood_fill(visitor);
  make_manifold();
  for (const Vertex_handle v : m_dt.finite_vertex_handles())
    if (is_non_manifold(v)) throw texmesh::GeometryFailure("the wrap is not a manifold");
  std::unordered_map<Vertex_handle, std::uint32_t> number;
  for (auto it = m_dt.finite_facets_begin(); it != m_dt.finite_facets_end(); ++it) {
    const Facet facet = it->first->info().is_outside ? *it : m_dt.mirror_facet(*it);
    const auto [cell, across] = facet;
    if (cell->info().is_outside == cell->neighbor(across)->info().is_outside) continue;
    texmesh::Triangle& triangle = wrap.triangles.emplace_back();
    for (int k = 0; k < 3; ++k) {
      const Vertex_handle v = cell->vertex(Dt::vertex_triple_index(across, k));
      const auto [at, is_new] = number.emplace(v, static_cast<std::uint32_t>(wrap.points.size()));
      if (is_new) wrap.points.push_back(texmesh::vec(m_dt.point(v)));
      triangle[static_cast<std::size_t>(k)] = at->second;
    }
  }
}

}  // namespace CGAL::Alpha_wraps_3::internal

namespace texmesh {

TriangleSoup alpha_wrap(const TriangleSoup& soup, double alpha, double offset, std::size_t max_steps,
                        const RunContext& context) {
  WorkCap cap(max_steps, context);
  const SoupOracle oracle(soup, cap);
  return with_cgal_checks([&] {
    TriangleSoup wrap;
    Wrapper wrapper(oracle);
    wrapper(alpha, offset, wrap, StepCounter(cap));
    return wrap;
  });
}

}  // namespace texmesh
