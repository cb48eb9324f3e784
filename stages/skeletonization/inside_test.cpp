// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/skeletonization/contraction_parts.h"

#include <CGAL/AABB_traits.h>
#include <CGAL/AABB_tree.h>
#include <CGAL/AABB_triangle_primitive.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/internal/Side_of_triangle_mesh/Point_inside_vertical_ray_cast.h>

#include "stages/skeletonization/wrap.h"

namespace texmesh {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
constexpr int kMaxRays = 1000;
/// Rays in a row from the same point, in the contraction that this thread is in.
thread_local int rays_in_a_row = 0;

/// The kernel, but for rays: every one is counted, and too many from one point are an error.
struct CountingKernel : Kernel {
  struct Construct_ray_3 {
    using result_type = Kernel::Ray_3;
    Kernel::Ray_3 operator()(const Kernel::Point_3& from, const Kernel::Vector_3& along) const {
      rays_in_a_row = from == last ? rays_in_a_row + 1 : 0;
      last = from;
      if (rays_in_a_row > kMaxRays) throw GeometryFailure("contraction cannot tell inside from outside");
      return Kernel::Ray_3(from, along);
    }
    static thread_local Kernel::Point_3 last;
  };
  Construct_ray_3 construct_ray_3_object() const { return {}; }
};
thread_local Kernel::Point_3 CountingKernel::Construct_ray_3::last{0, 0, 0};

using Primitive =
    CGAL::AABB_triangle_primitive<CountingKernel, std::vector<Kernel::Triangle_3>::const_iterator>;
using AabbTree = CGAL::AABB_tree<CGAL::AABB_traits<CountingKernel, Primitive>>;

Kernel::Point_3 cgal_point(const Vec3d& p) { return {p.x, p.y, p.z}; }

std::vector<Kernel::Triangle_3> cgal_triangles(const std::vector<InsideTest::Corners>& triangles) {
  std::vector<Kernel::Triangle_3> out;
  out.reserve(triangles.size());
  for (const auto& t : triangles) out.emplace_back(cgal_point(t[0]), cgal_point(t[1]), cgal_point(t[2]));
  return out;
}

}  // namespace

struct InsideTest::Tree {
  explicit Tree(const std::vector<Corners>& corners)
      : triangles(cgal_triangles(corners)), tree(triangles.begin(), triangles.end()) {
    tree.build();
  }
  std::vector<Kernel::Triangle_3> triangles;
  AabbTree tree;
};

InsideTest::InsideTest(const std::vector<Corners>& triangles) : tree_(std::make_unique<Tree>(triangles)) {}
InsideTest::~InsideTest() = default;

void InsideTest::forget_rays() { rays_in_a_row = 0; }

bool InsideTest::is_inside(Vec3d point) const {
  const Kernel::Point_3 from = cgal_point(point);
  const CGAL::Bbox_3 box = tree_->tree.bbox();
  for (int k = 0; k < 3; ++k)
    if (from[k] < box.min(k) || from[k] > box.max(k)) return false;
  return CGAL::internal::Point_inside_vertical_ray_cast<CountingKernel, AabbTree>()(
             from, tree_->tree, CountingKernel().construct_ray_3_object(),
             CountingKernel().construct_vector_3_object()) == CGAL::ON_BOUNDED_SIDE;
}

}  // namespace texmesh
