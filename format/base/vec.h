#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <limits>

namespace texmesh {

/// Stands for "no vertex", "no triangle", "no fragment" ... wherever an index has 32 bits.
inline constexpr std::uint32_t kNoIndex = 0xffffffffu;

template <class T>
struct Vec2 {
  T x{}, y{};
  friend bool operator==(const Vec2&, const Vec2&) = default;
  friend Vec2 operator+(Vec2 a, Vec2 b) { return {a.x + b.x, a.y + b.y}; }
  friend Vec2 operator-(Vec2 a, Vec2 b) { return {a.x - b.x, a.y - b.y}; }
  friend Vec2 operator*(Vec2 a, T s) { return {a.x * s, a.y * s}; }
};

template <class T>
struct Vec3 {
  T x{}, y{}, z{};
  friend bool operator==(const Vec3&, const Vec3&) = default;
  friend Vec3 operator+(Vec3 a, Vec3 b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
  friend Vec3 operator-(Vec3 a, Vec3 b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
  friend Vec3 operator*(Vec3 a, T s) { return {a.x * s, a.y * s, a.z * s}; }
  T& operator[](int i) { return i == 0 ? x : i == 1 ? y : z; }
  T operator[](int i) const { return i == 0 ? x : i == 1 ? y : z; }
};

template <class T>
struct Vec4 {
  T x{}, y{}, z{}, w{};
  friend bool operator==(const Vec4&, const Vec4&) = default;
};

using Vec2f = Vec2<float>;
using Vec2d = Vec2<double>;
using Vec3f = Vec3<float>;
using Vec3d = Vec3<double>;
using Vec4f = Vec4<float>;

template <class T>
T dot(Vec2<T> a, Vec2<T> b) {
  return a.x * b.x + a.y * b.y;
}
template <class T>
T cross(Vec2<T> a, Vec2<T> b) {
  return a.x * b.y - a.y * b.x;
}
template <class T>
T dot(Vec3<T> a, Vec3<T> b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class T>
Vec3<T> cross(Vec3<T> a, Vec3<T> b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/// std::sqrt is correctly rounded everywhere, so length() is the same on every machine.
template <class T>
T length(Vec3<T> a) {
  return std::sqrt(dot(a, a));
}
template <class T>
Vec3<T> normalized(Vec3<T> a) {
  const T l = length(a);
  return l > 0 ? a * (1 / l) : Vec3<T>{};
}
inline Vec3d to_double(Vec3f a) { return {a.x, a.y, a.z}; }
inline Vec3f to_float(Vec3d a) {
  return {static_cast<float>(a.x), static_cast<float>(a.y), static_cast<float>(a.z)};
}
inline Vec2d to_double(Vec2f a) { return {a.x, a.y}; }

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
