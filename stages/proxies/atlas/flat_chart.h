#pragma once
// Inside proxies only: a chart's triangles laid into a plane.
#include <array>
#include <span>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

/// Two unit vectors of the plane across a normal: x to the right and y up for who looks at the front.
struct PlaneAxes {
  Vec3d x, y;
  explicit PlaneAxes(Vec3d unit_normal);
  Vec2d operator()(Vec3d p) const { return {dot(p, x), dot(p, y)}; }
};

/// A triangle in its own plane: corners at (0, 0), (base, 0) and apex; base and apex.y are above 0.
struct OwnPlane {
  double base = 0;
  Vec2d apex;
  OwnPlane() = default;
  explicit OwnPlane(const std::array<Vec3d, 3>& corners);
  double area() const { return base * apex.y / 2; }
};

/// The map from a triangle's own plane to three places: what it does to lengths and to areas.
struct FlatStretch {
  double largest2 = 0, least2 = 0;  // squares of the singular values
  double area = 0;                  // of the places; not above 0 when the triangle flips or has none
};
FlatStretch flat_stretch(const OwnPlane& own, const Vec2d* places);

/// Half-edges 3 t + k, which are a chart's border, do not meet in the plane but at common vertices.
/// `vertices` and `places`: per corner 3 t + k. With no triangle flipped, this says that no two triangles of
/// a disk overlap.
bool border_is_simple(std::span<const std::uint32_t> half_edges, const std::vector<std::uint32_t>& vertices,
                      const std::vector<Vec2d>& places);

/// The unit vector along one side of the smallest box around the points; {1, 0} when they have no extent.
Vec2d smallest_box_side(std::vector<Vec2d> points);

}  // namespace texmesh
