#pragma once
// Inside proxies only: the run of collapses.
#include <cstddef>
#include <cstdint>
#include <vector>

#include "format/base/vec.h"
#include "format/model/model.h"
#include "stages/base/run_context.h"
#include "stages/proxies/surface/corner_rings.h"
#include "stages/proxies/surface/pair_queue.h"
#include "stages/proxies/surface/surface_quadrics.h"

namespace texmesh {

/// How much shape a collapse may cost. A run starts with kFair; the others take over when nothing else goes.
enum class CollapseGuard : std::uint8_t { kFair, kLax, kNone };

/// Collapses edges of a soup, cheapest first.
class SurfaceCollapse {
 public:
  SurfaceCollapse(std::vector<Vec3d> places, std::vector<Triangle> triangles,
                  const std::vector<std::uint32_t>& group, double border_width);

  /// Goes on until at most `triangle_count` (>= 1) triangles are left. Throws Cancelled.
  void run(std::size_t triangle_count, const RunContext& context);

  const CornerRings& rings() const { return rings_; }
  const std::vector<Vec3d>& places() const { return quadrics_.places(); }

 private:
  void queue_all_edges();
  void queue_edges_of(std::uint32_t vertex);
  bool collapse(const QueuedPair& edge);
  bool keeps_shape(std::uint32_t a, std::uint32_t b, Vec3d place) const;
  bool keeps_triangle(std::uint32_t triangle, std::uint32_t a, std::uint32_t b, Vec3d place) const;
  void find_folded(std::uint32_t a, std::uint32_t b);
  double folded_cost() const;
  void apply(std::uint32_t a, std::uint32_t b, Vec3d place);
  void drop_smallest(std::size_t triangle_count);
  Vec3d doubled_area(std::uint32_t triangle) const;

  CornerRings rings_;
  SurfaceQuadrics quadrics_;
  PairQueue queue_;
  CollapseGuard guard_ = CollapseGuard::kFair;
  std::vector<std::uint32_t> at_a_, at_b_;  // triangles of the edge in hand
  std::vector<std::uint32_t> folded_;       // those that lie on each other after the collapse in hand
  std::vector<std::uint32_t> neighbours_;
};

}  // namespace texmesh
