#include "stages/geometry/tetrahedron.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace texmesh {
namespace {

/// The corners of each side, so that cross(second - first, third - first) looks inwards.
constexpr std::size_t kSides[4][3] = {{1, 3, 2}, {0, 2, 3}, {0, 3, 1}, {0, 1, 2}};

/// A triangle clipped by four half-spaces has at most seven corners.
struct Polygon {
  std::array<Vec3d, 8> corner;
  std::size_t count = 0;
};

}  // namespace

Tetrahedron::Tetrahedron(const std::array<Vec3d, 4>& corners)
    : corners_(corners), box_(bounding_box(corners)) {
  for (std::size_t s = 0; s < 4; ++s) {
    const Vec3d at = corners[kSides[s][0]];
    planes_[s] = {cross(corners[kSides[s][1]] - at, corners[kSides[s][2]] - at), at};
  }
}

bool Tetrahedron::may_meet_box(const Box3d& box) const {
  for (int k = 0; k < 3; ++k)
    if (box.min[k] > box_.max[k] || box.max[k] < box_.min[k]) return false;
  const Vec3d middle = box.centre(), half = (box.max - box.min) * 0.5;
  for (const Plane& s : planes_)
    if (s.height(middle) + std::fabs(s.inwards.x) * half.x + std::fabs(s.inwards.y) * half.y +
            std::fabs(s.inwards.z) * half.z <
        0)
      return false;
  return true;
}

bool Tetrahedron::meets(const std::array<Vec3d, 3>& triangle) const {
  // Most triangles are asked in vain: near a surface cells lie along it, on one side.
  const Vec3d normal = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
  int above = 0, below = 0;
  for (const Vec3d& c : corners_) {
    const double h = dot(normal, c - triangle[0]);
    above += h > 0, below += h < 0;
  }
  if (above == 4 || below == 4) return false;
  for (const Plane& s : planes_)
    if (s.height(triangle[0]) < 0 && s.height(triangle[1]) < 0 && s.height(triangle[2]) < 0) return false;
  return clipped(triangle);
}

bool Tetrahedron::clipped(const std::array<Vec3d, 3>& triangle) const {
  Polygon in;
  in.count = 3;
  std::copy(triangle.begin(), triangle.end(), in.corner.begin());
  for (const Plane& s : planes_) {
    std::array<double, 8> height{};
    bool inside = true;
    for (std::size_t i = 0; i < in.count; ++i) {
      height[i] = s.height(in.corner[i]);
      inside = inside && height[i] >= 0;
    }
    if (inside) continue;
    Polygon out;
    for (std::size_t i = 0; i < in.count; ++i) {
      const std::size_t j = i + 1 < in.count ? i + 1 : 0;
      if (height[i] >= 0) out.corner[out.count++] = in.corner[i];
      if ((height[i] < 0) != (height[j] < 0))
        out.corner[out.count++] =
            in.corner[i] + (in.corner[j] - in.corner[i]) * (height[i] / (height[i] - height[j]));
    }
    if (out.count == 0) return false;
    in = out;
  }
  return true;
}

}  // namespace texmesh
