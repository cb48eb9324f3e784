#pragma once
// Inside proxies only: triangles grow together to charts.
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/vec.h"
#include "stages/base/run_context.h"
#include "stages/proxies/atlas_mesh.h"
#include "stages/proxies/charts/chart_layout.h"
#include "stages/proxies/surface/pair_queue.h"

namespace texmesh {

/// A chart that still grows. Dead ones, which are part of another, have no triangle.
struct GrowingChart {
  std::vector<std::uint32_t> triangles, border;  // border: half-edges 3 t + k, in no order
  Vec3d area_normal;                             // sum of unit normals times areas
  double area = 0, perimeter = 0;
  struct Refusal {
    std::uint32_t triangle;  // of the other chart
    std::size_t triangles;   // of both together
  };
  std::vector<Refusal> refusals;  // others that it could not be merged with
};

/// Merges neighbouring charts, beginning with one per triangle, the flattest and roundest result first, as
/// long as the result is a chart that segment_charts promises.
class ChartMerge {
 public:
  explicit ChartMerge(const ProxySurface& surface);
  void run(const RunContext& context);
  const std::vector<GrowingChart>& charts() const { return charts_; }
  const ChartLayout& layout() const { return layout_; }
  /// Per corner 3 t + k: corners that are one vertex of a chart have one number, below 3 times the triangles.
  const std::vector<std::uint32_t>& vertices() const { return vertices_; }

 private:
  void measure_triangles();
  void find_opposites();
  void pair_half_edges(std::span<const std::uint32_t> half_edges);
  void start_charts();
  void queue_neighbours(std::uint32_t chart, bool later_ones_only);
  double merge_cost(const GrowingChart& a, const GrowingChart& b, double shared_length) const;
  std::vector<std::uint32_t> longest_common_path(std::uint32_t a, std::uint32_t b) const;
  void glue(std::span<const std::uint32_t> path, std::span<const std::uint32_t> triangles);
  bool try_merge(std::uint32_t a, std::uint32_t b);
  bool was_refused(std::uint32_t a, std::uint32_t b) const;
  std::vector<std::uint32_t> joint_border(std::uint32_t a, std::uint32_t b,
                                          std::span<const std::uint32_t> path);
  std::uint32_t start_of(std::uint32_t half_edge) const {
    return surface_.triangles[half_edge / 3][half_edge % 3];
  }

  const ProxySurface& surface_;
  std::vector<Vec3d> area_normals_;       // per triangle: unit normal times area
  std::vector<double> areas_;             // per triangle
  std::vector<double> lengths_;           // per half-edge
  std::vector<std::uint32_t> opposites_;  // per half-edge; kNoIndex where no chart goes on
  std::vector<std::uint32_t> chart_of_;   // per triangle
  std::vector<GrowingChart> charts_;
  PairQueue queue_;
  ChartLayout layout_;
  std::vector<std::uint32_t> vertices_;  // per corner: corners that are one vertex of a chart have one number
  std::vector<std::uint8_t> glued_;      // per half-edge: 1 on the path in hand
  std::vector<std::uint32_t> renamed_;   // per vertex: its new number, or kNoIndex
  std::vector<double> shared_lengths_;   // per chart; 0 between calls
  std::vector<std::uint32_t> neighbours_;
};

}  // namespace texmesh
