#pragma once
#include <cmath>
#include <cstdint>

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

}  // namespace texmesh
