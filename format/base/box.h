#pragma once
#include <algorithm>
#include <iterator>
#include <limits>

#include "format/base/vec.h"

namespace texmesh {

/// An axis-aligned box; empty at first. Coordinates are compared and never rounded, so the order of points
/// makes no difference. NaNs are ignored.
template <class T>
struct Box3 {
  static constexpr T kInfinity = std::numeric_limits<T>::infinity();
  Vec3<T> min{kInfinity, kInfinity, kInfinity}, max{-kInfinity, -kInfinity, -kInfinity};

  void extend(Vec3<T> p) { extend(Box3{p, p}); }
  void extend(const Box3& other) {
    for (int k = 0; k < 3; ++k) {
      min[k] = std::min(min[k], other.min[k]);
      max[k] = std::max(max[k], other.max[k]);
    }
  }
  bool empty() const { return !(min.x <= max.x); }
  Vec3<T> size() const { return empty() ? Vec3<T>{} : max - min; }
  T diagonal() const { return length(size()); }
  T longest_side() const {
    const Vec3<T> s = size();
    return std::max({s.x, s.y, s.z});
  }
  int longest_axis() const {
    const Vec3<T> s = size();
    const int larger = s.y > s.x ? 1 : 0;
    return s.z > s[larger] ? 2 : larger;
  }
  /// Only of a box that is not empty.
  Vec3<T> centre() const { return (min + max) * T{0.5}; }
};

using Box3f = Box3<float>;
using Box3d = Box3<double>;

inline Box3d to_double(const Box3f& b) { return {to_double(b.min), to_double(b.max)}; }

/// The box around points: a range of Vec3<T>.
auto bounding_box(const auto& points) {
  Box3<decltype(std::begin(points)->x)> box;
  for (const auto& p : points) box.extend(p);
  return box;
}

struct BoundingSphere {
  Vec3d centre;
  double radius = 0;
};

/// The sphere around the middle of the points' box that holds them all. At least one point.
BoundingSphere bounding_sphere(const auto& points) {
  BoundingSphere sphere{to_double(bounding_box(points)).centre()};
  for (const Vec3f p : points) sphere.radius = std::max(sphere.radius, length(to_double(p) - sphere.centre));
  return sphere;
}

}  // namespace texmesh
