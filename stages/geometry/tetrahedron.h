#pragma once
#include <array>

#include "format/base/box.h"
#include "format/base/vec.h"

namespace texmesh {

/// A solid tetrahedron that is asked what it meets, in plain double arithmetic: what only touches it may be
/// answered either way.
class Tetrahedron {
 public:
  /// Corners a, b, c, d with dot(cross(b - a, c - a), d - a) > 0, or so flat that rounding hides it.
  explicit Tetrahedron(const std::array<Vec3d, 4>& corners);

  /// False when it surely meets no part of the box; true may be wrong.
  bool may_meet_box(const Box3d& box) const;
  /// Whether it and a triangle, inside included, have a point in common.
  bool meets(const std::array<Vec3d, 3>& triangle) const;

 private:
  struct Plane {
    Vec3d inwards, point;
    double height(Vec3d p) const { return dot(inwards, p - point); }
  };
  /// Whether the four sides leave anything of a triangle.
  bool clipped(const std::array<Vec3d, 3>& triangle) const;

  std::array<Vec3d, 4> corners_;
  std::array<Plane, 4> planes_;
  Box3d box_;
};

}  // namespace texmesh
