// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/skeletonization/curve_skeleton.h"

#include <CGAL/memory.h>

#include <type_traits>

#include "stages/skeletonization/contraction_parts.h"

namespace texmesh {
namespace {

/// Memory whose addresses have the same order in every run. CGAL's contraction keeps edges in a std::set
/// ordered by address, and with the system's allocator its skeleton varies from run to run (95 to 103 nodes
/// on one scan).
class Arena {
 public:
  explicit Arena(std::size_t capacity)
      : bytes_(std::make_unique_for_overwrite<std::byte[]>(capacity)), capacity_(capacity) {}

  void* allocate(std::size_t size) {
    size = (size + kAlignment - 1) / kAlignment * kAlignment;
    std::vector<void*>& free = free_of(size);
    if (!free.empty()) {
      void* p = free.back();
      free.pop_back();
      return p;
    }
    // Not bad_alloc: the capacity depends on the input alone, a machine's memory does not.
    if (capacity_ - used_ < size) throw GeometryFailure("contraction needs too much memory");
    void* p = bytes_.get() + used_;
    used_ += size;
    return p;
  }

  void release(void* p, std::size_t size) {
    free_of((size + kAlignment - 1) / kAlignment * kAlignment).push_back(p);
  }

 private:
  static constexpr std::size_t kAlignment = alignof(std::max_align_t);

  /// A polyhedron has three kinds of parts: a list is faster than a map.
  std::vector<void*>& free_of(std::size_t size) {
    for (auto& [s, list] : free_)
      if (s == size) return list;
    return free_.emplace_back(size, std::vector<void*>()).second;
  }

  std::unique_ptr<std::byte[]> bytes_;
  std::size_t capacity_, used_ = 0;
  std::vector<std::pair<std::size_t, std::vector<void*>>> free_;
};

/// The arena of the contraction that this thread is in; CGAL default-constructs its allocators, so it cannot
/// be passed.
thread_local Arena* current_arena = nullptr;

class ArenaScope {
 public:
  explicit ArenaScope(Arena& arena) : outer_(std::exchange(current_arena, &arena)) {}
  ~ArenaScope() { current_arena = outer_; }
  ArenaScope(const ArenaScope&) = delete;
  ArenaScope& operator=(const ArenaScope&) = delete;

 private:
  Arena* outer_;
};

template <class T>
struct ContractionAllocator {
  using value_type = T;
  ContractionAllocator() = default;
  template <class U>
  ContractionAllocator(const ContractionAllocator<U>&) {}
  T* allocate(std::size_t n) { return static_cast<T*>(current_arena->allocate(n * sizeof(T))); }
  void deallocate(T* p, std::size_t n) { current_arena->release(p, n * sizeof(T)); }
  template <class U>
  bool operator==(const ContractionAllocator<U>&) const {
    return true;
  }
};

}  // namespace
}  // namespace texmesh

// The allocator is a template parameter of Polyhedron_3 with this macro as its default, and the contraction
// names no other. Only the one forward declaration that holds the default sees our value, so no other CGAL
// type changes.
#pragma push_macro("CGAL_ALLOCATOR")
#undef CGAL_ALLOCATOR
#define CGAL_ALLOCATOR(T) texmesh::ContractionAllocator<T>
#include <CGAL/Polyhedron_3_fwd.h>
#pragma pop_macro("CGAL_ALLOCATOR")

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Mean_curvature_flow_skeletonization.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/helpers.h>

namespace texmesh {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

using Contraction =
    CGAL::Mean_curvature_flow_skeletonization<SurfaceMesh, CGAL::Default, CGAL::Default, NormalEquations>;

using MesoSkeleton = Contraction::Meso_skeleton;

static_assert(std::is_same_v<MesoSkeleton::Allocator, ContractionAllocator<int>>);

Vec3d vec(const auto& p) { return {p.x(), p.y(), p.z()}; }

/// The poles of the contraction that this thread is in, by the surface's points: CGAL keeps a few of them.
thread_local std::vector<Vec3d> poles_found;

/// The last answers of the contraction's inside test, in the order of the questions.
thread_local std::vector<bool> last_answers;

}  // namespace
}  // namespace texmesh

/// CGAL's own with the tree and the predicates in a file of their own.
template <>
class CGAL::Side_of_triangle_mesh<texmesh::MesoSkeleton, texmesh::Kernel> {
 public:
  explicit Side_of_triangle_mesh(const texmesh::MesoSkeleton& mesh) : test_(triangles_of(mesh)) {
    texmesh::last_answers.clear();
  }

  CGAL::Bounded_side operator()(const texmesh::Kernel::Point_3& p) const {
    const bool inside = test_.is_inside(texmesh::vec(p));
    texmesh::last_answers.push_back(inside);
    return inside ? CGAL::ON_BOUNDED_SIDE : CGAL::ON_UNBOUNDED_SIDE;
  }

 private:
  static std::vector<texmesh::InsideTest::Corners> triangles_of(const texmesh::MesoSkeleton& mesh) {
    CGAL_assertion(CGAL::is_triangle_mesh(mesh));
    CGAL_assertion(CGAL::is_closed(mesh));
    std::vector<texmesh::InsideTest::Corners> triangles;
    for (const auto face : faces(mesh)) {
      const auto h = face->halfedge();
      triangles.push_back({texmesh::vec(h->vertex()->point()), texmesh::vec(h->next()->vertex()->point()),
                           texmesh::vec(h->next()->next()->vertex()->point())});
    }
    return triangles;
  }

  texmesh::InsideTest test_;
};

/// CGAL's own with the exact triangulation in a file of its own, since either takes long to compile.
template <>
void texmesh::Contraction::compute_voronoi_pole() {
  compute_vertex_normal();
  std::vector<texmesh::Vec3d> points(num_vertices(m_tmesh)), normals(points.size());
  for (const auto v : vertices(m_tmesh)) {
    points[v->id()] = texmesh::vec(v->point());
    normals[v->id()] = texmesh::vec(m_normals[v->id()]);
  }
  const std::vector<texmesh::Vec3d> poles = texmesh::voronoi_poles(points, normals);
  texmesh::poles_found.assign(poles.size(), {});
  for (const auto v : vertices(m_tmesh)) {
    const texmesh::Vec3d& pole = poles[v->id()];
    v->pole = Point(pole.x, pole.y, pole.z);
    texmesh::poles_found[v->vertices.front()] = pole;  // the copy has another order than the surface
  }
  m_are_poles_computed = true;
}

/// CGAL's own, but for where the poles are: assemble_LHS has asked just before, of the same vertices in the
/// same order.
template <>
void texmesh::Contraction::assemble_RHS(SolverTraits::Vector& x, SolverTraits::Vector& y,
                                        SolverTraits::Vector& z) {
  const std::size_t count = num_vertices(m_tmesh);
  std::size_t asked = 0;
  const auto set = [&](std::size_t row, const Point& p, double weight) {
    x[row] = p.x() * weight, y[row] = p.y() * weight, z[row] = p.z() * weight;
  };
  for (const auto v : vertices(m_tmesh)) {
    const auto id = static_cast<int>(v->id());
    const auto i = static_cast<std::size_t>(m_new_id[id]);
    const bool pole = !v->is_fixed && id < m_max_id && texmesh::last_answers.at(asked++);
    set(i, {0, 0, 0}, 0);
    set(i + count, v->point(), v->is_fixed ? 1.0 / m_zero_TH : m_omega_H);
    set(i + 2 * count, v->pole, pole ? m_omega_P : 0);
  }
}

namespace texmesh {
namespace {

SurfaceMesh closed_mesh(const TriangleSoup& closed) {
  SurfaceMesh mesh;
  for (const Vec3d& p : closed.points) mesh.add_vertex({p.x, p.y, p.z});
  using Vertex = SurfaceMesh::Vertex_index;
  for (const Triangle& t : closed.triangles)
    if (mesh.add_face(Vertex(t[0]), Vertex(t[1]), Vertex(t[2])) == SurfaceMesh::null_face())
      throw GeometryFailure("wrap is not a manifold");
  if (!CGAL::is_closed(mesh)) throw GeometryFailure("wrap is not closed");
  return mesh;
}

/// Whether each pole lies inside: normals that mislead put some outside.
std::vector<bool> poles_inside(const TriangleSoup& closed) {
  std::vector<InsideTest::Corners> corners;
  for (const Triangle& t : closed.triangles)
    corners.push_back({closed.points[t[0]], closed.points[t[1]], closed.points[t[2]]});
  const InsideTest test(corners);
  std::vector<bool> inside;
  for (const Vec3d& pole : poles_found) inside.push_back(test.is_inside(pole));
  return inside;
}

CurveSkeleton contract(const TriangleSoup& closed, int max_contractions) {
  const SurfaceMesh mesh = closed_mesh(closed);
  // A triangle and its share of edges and vertices take about 400 bytes; the contraction splits edges as it
  // goes.
  Arena arena((std::size_t{16} << 20) + closed.triangles.size() * 4096);
  const ArenaScope scope(arena);
  InsideTest::forget_rays();
  Contraction::Skeleton graph;
  Contraction contraction(mesh);
  contraction.set_max_iterations(static_cast<std::size_t>(max_contractions));
  contraction.contract_until_convergence();
  contraction.convert_to_skeleton(graph);
  const std::vector<bool> inside = poles_inside(closed);
  CurveSkeleton out;
  std::vector<NodePoles> poles;
  for (const auto v : CGAL::make_range(vertices(graph))) {
    out.nodes.push_back(vec(graph[v].point));
    NodePoles& of_node = poles.emplace_back();
    for (const auto p : graph[v].vertices)
      if (inside[p]) of_node.sum = of_node.sum + poles_found[p], ++of_node.count;
  }
  for (const auto e : CGAL::make_range(edges(graph)))
    out.segments.push_back(
        {static_cast<std::uint32_t>(source(e, graph)), static_cast<std::uint32_t>(target(e, graph))});
  recentre(out, poles);
  return out;
}

}  // namespace

CurveSkeleton contract_to_skeleton(const TriangleSoup& closed, int max_contractions) {
  return with_cgal_checks([&] { return contract(closed, max_contractions); });
}

}  // namespace texmesh
