#pragma once
// Inside proxies only: what a collapse costs and where it leads.
#include <cstdint>
#include <vector>

#include "format/base/vec.h"
#include "format/model/model.h"
#include "stages/geometry/quadric.h"

namespace texmesh {

/// Vertices with the planes of the triangles and borders that they stand for.
/// Borders, and outlines of groups, get planes that stand upright on their triangles. A border's weight is
/// its length times border_width: as if a strip of that width stood there. So it does not depend on how
/// finely the border is divided. A component has no wider strip than the side of a square of its area, so
/// dust is not held by its borders.
class SurfaceQuadrics {
 public:
  SurfaceQuadrics(std::vector<Vec3d> places, const std::vector<Triangle>& triangles,
                  const std::vector<std::uint32_t>& group, double border_width);

  struct Target {
    Vec3d place;
    double cost = 0;  // area times squared distance
  };
  const Vec3d& place(std::uint32_t vertex) const { return places_[vertex]; }
  const std::vector<Vec3d>& places() const { return places_; }
  /// The cheapest place for two vertices that become one.
  Target best_target(std::uint32_t a, std::uint32_t b) const;
  /// The cheapest of both ends and the middle.
  Target plain_target(std::uint32_t a, std::uint32_t b) const;
  void merge(std::uint32_t from, std::uint32_t to, Vec3d place);

 private:
  double cost_at(const Quadric& sum, std::uint32_t a, std::uint32_t b, Vec3d place) const;
  void add_triangles(const std::vector<Triangle>& triangles);
  void add_borders(const std::vector<Triangle>& triangles, const std::vector<std::uint32_t>& group,
                   double border_width);

  std::vector<Vec3d> places_;
  std::vector<Quadric> quadrics_;
};

/// Sum over triangles, in double.
double area_of(const std::vector<Vec3d>& places, const std::vector<Triangle>& triangles);

}  // namespace texmesh
