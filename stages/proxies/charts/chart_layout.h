#pragma once
// Inside proxies only: the places of a chart's corners in a plane.
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/vec.h"
#include "stages/proxies/atlas_mesh.h"
#include "stages/proxies/charts/flat_chart.h"

namespace texmesh {

/// Lays disks of triangles into planes, and keeps the places of those that became charts. A chart's area in
/// its plane is its area on the surface.
class ChartLayout {
 public:
  /// Every triangle lies in its own plane at first.
  explicit ChartLayout(const ProxySurface& surface);

  /// Looks for places of a disk: along its mean normal where that hardly stretches, else those that keep its
  /// angles. False when a triangle would flip, two would overlap, or the stretch is too large.
  /// `vertices`: per corner 3 t + k of the surface, a number below 3 times the triangles; corners of the disk
  /// with one number have one place.
  bool try_disk(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                const std::vector<std::uint32_t>& vertices, Vec3d area_normal);
  /// The places of the disk just tried become the chart's.
  void keep_tried(std::span<const std::uint32_t> triangles);
  /// Per corner 3 t + k, object units; y grows upwards for who looks at the front.
  const std::vector<Vec2d>& places() const { return places_; }

 private:
  void project(std::span<const std::uint32_t> triangles, Vec3d area_normal);
  bool unfold(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
              const std::vector<std::uint32_t>& vertices);
  std::size_t number_vertices(std::span<const std::uint32_t> triangles,
                              const std::vector<std::uint32_t>& vertices);
  bool is_sound(std::span<const std::uint32_t> triangles, std::span<const std::uint32_t> border,
                const std::vector<std::uint32_t>& vertices, double most_stretch);
  Vec3d corner_position(std::uint32_t corner) const {
    return to_double(surface_.positions[surface_.triangles[corner / 3][corner % 3]]);
  }
  std::uint32_t farthest(std::span<const std::uint32_t> border, Vec3d from) const;

  const ProxySurface& surface_;
  std::vector<OwnPlane> own_;             // per triangle
  std::vector<Vec2d> places_, tried_;     // per corner
  std::vector<std::uint32_t> number_of_;  // per vertex: its number in the disk that is tried
  std::vector<Triangle> disk_;            // the disk's triangles, by these numbers
  std::vector<OwnPlane> disk_own_;
};

}  // namespace texmesh
