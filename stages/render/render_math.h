#pragma once
// Inside the room only: functions of shading with the same bits on every machine.
#include "format/base/vec.h"
#include "stages/base/float_math.h"

namespace texmesh {

inline constexpr float kFloatPi = 3.14159265358979323846f;

/// 0..1; NaN becomes 0.
template <Float F>
F saturated(F x) {
  return clamped(x, 0, 1);
}
template <Float F>
Vec3<F> product(Vec3<F> a, Vec3<F> b) {
  return {a.x * b.x, a.y * b.y, a.z * b.z};
}
template <Float F>
F largest(Vec3<F> a) {
  const F xy = a.x > a.y ? a.x : a.y;
  return xy > a.z ? xy : a.z;
}
/// The same vector in every lane.
template <Float F>
Vec3<F> each(Vec3f a) {
  return {F{} + a.x, F{} + a.y, F{} + a.z};
}
inline Vec3<Lanes> normalized(Vec3<Lanes> a) {
  const Lanes length = root_of(dot(a, a)), scale = 1 / length;
  return {length > 0 ? a.x * scale : 0.f, length > 0 ? a.y * scale : 0.f, length > 0 ? a.z * scale : 0.f};
}
inline bool is_finite(Vec3f a) {
  constexpr float kMost = 3e38f;
  return a.x >= -kMost && a.x <= kMost && a.y >= -kMost && a.y <= kMost && a.z >= -kMost && a.z <= kMost;
}

/// -1..1 in both; |x| + |y| > 1 is the lower half, y < 0. The vector need not be unit; of no direction the
/// place is the middle.
template <Float F>
Vec2<F> octahedral(Vec3<F> d) {
  auto size = [](F v) -> F { return v < 0 ? -v : v; };
  const F sum = size(d.x) + size(d.y) + size(d.z), inverse = 1 / sum;
  const F scale = sum > 0 ? inverse : 0.f;
  const F x = d.x * scale, y = d.z * scale;
  const F x_below = (1 - size(y)) * (x < 0 ? F{} - 1 : F{} + 1),
          y_below = (1 - size(x)) * (y < 0 ? F{} - 1 : F{} + 1);
  return {d.y >= 0 ? x : x_below, d.y >= 0 ? y : y_below};
}

/// The reverse, unit. Places up to 1 beyond a border are those on the other side of the same edge.
inline Vec3f octahedral_direction(Vec2f place) {
  auto size = [](float v) { return v < 0 ? -v : v; };
  float x = place.x, y = place.y;
  if (size(x) > 1) x = (x < 0 ? -2.f : 2.f) - x, y = -y;
  if (size(y) > 1) y = (y < 0 ? -2.f : 2.f) - y, x = -x;
  const float up = 1 - size(x) - size(y);
  if (up >= 0) return normalized(Vec3f{x, up, y});
  return normalized(Vec3f{(1 - size(y)) * (x < 0 ? -1.f : 1.f), up, (1 - size(x)) * (y < 0 ? -1.f : 1.f)});
}

/// One for all; the same on every machine.
inline const SrgbEncoder<float, false>& srgb_encoder() {
  static const SrgbEncoder<float, false> encoder;
  return encoder;
}

}  // namespace texmesh
