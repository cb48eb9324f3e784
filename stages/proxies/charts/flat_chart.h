#pragma once
// Inside proxies only: a chart's triangles laid into a plane.
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/vec.h"
#include "stages/proxies/atlas_mesh.h"

namespace texmesh {

/// Two unit vectors of the plane across a normal: x to the right and y up for who looks at the front.
struct PlaneAxes {
  Vec3d x, y;
  explicit PlaneAxes(Vec3d unit_normal);
  Vec2d operator()(Vec3d p) const { return {dot(p, x), dot(p, y)}; }
};

/// Half-edges 3 t + k, which are a chart's border, do not meet in the plane but at common corners. With no
/// triangle flipped, this says that no two triangles of a disk overlap.
bool border_is_simple(const ProxySurface& surface, std::span<const std::uint32_t> half_edges,
                      const PlaneAxes& axes);

/// The unit vector along the longer or shorter side of the smallest box around the points; {1, 0} when they
/// have no extent.
Vec2d smallest_box_side(std::vector<Vec2d> points);

}  // namespace texmesh
