// CGAL's checks stay on in release builds: a broken invariant is an exception that the caller falls back on,
// not a crash.
#define CGAL_DEBUG
#include "stages/skeletonization/contraction.h"

#include <CGAL/memory.h>

#include <cstddef>
#include <memory>
#include <utility>

#include "stages/skeletonization/geometry_failure.h"

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

}  // namespace

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
#include <CGAL/Surface_mesh.h>
#include <CGAL/boost/graph/helpers.h>
#include <CGAL/extract_mean_curvature_flow_skeleton.h>

namespace texmesh {
namespace {

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using SurfaceMesh = CGAL::Surface_mesh<Kernel::Point_3>;

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

using Contraction = CGAL::Mean_curvature_flow_skeletonization<SurfaceMesh, CountingKernel>;

static_assert(std::is_same_v<Contraction::Meso_skeleton::Allocator, ContractionAllocator<int>>);

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

CurveSkeleton contract(const TriangleSoup& closed, int max_contractions) {
  const SurfaceMesh mesh = closed_mesh(closed);
  // A triangle and its share of edges and vertices take about 400 bytes; the contraction splits edges as it
  // goes.
  Arena arena((std::size_t{16} << 20) + closed.triangles.size() * 4096);
  const ArenaScope scope(arena);
  rays_in_a_row = 0;
  Contraction::Skeleton graph;
  Contraction contraction(mesh);
  contraction.set_max_iterations(static_cast<std::size_t>(max_contractions));
  contraction.contract_until_convergence();
  contraction.convert_to_skeleton(graph);
  CurveSkeleton out;
  for (const auto v : CGAL::make_range(vertices(graph))) {
    const auto& p = graph[v].point;
    out.nodes.push_back({p.x(), p.y(), p.z()});
  }
  for (const auto e : CGAL::make_range(edges(graph)))
    out.segments.push_back(
        {static_cast<std::uint32_t>(source(e, graph)), static_cast<std::uint32_t>(target(e, graph))});
  return out;
}

}  // namespace

CurveSkeleton contract_to_skeleton(const TriangleSoup& closed, int max_contractions) {
  // CGAL derives its failures from std::logic_error: nothing above could tell them from our own mistakes.
  try {
    return contract(closed, max_contractions);
  } catch (const CGAL::Failure_exception& e) {
    throw GeometryFailure(e.what());
  } catch (const CGAL::Uncertain_conversion_exception& e) {
    throw GeometryFailure(e.what());
  }
}

}  // namespace texmesh
