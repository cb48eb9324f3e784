#pragma once
// Inside the room only: functions of shading with the same bits on every machine.
#include "format/base/vec.h"
#include "stages/base/float_math.h"

namespace texmesh::render {

inline constexpr float kPi = 3.14159265358979323846f;

/// 0..1; NaN becomes 0.
inline float saturated(float x) { return clamped(x, 0, 1); }
inline Vec3f product(Vec3f a, Vec3f b) { return {a.x * b.x, a.y * b.y, a.z * b.z}; }
inline float largest(Vec3f a) {
  const float xy = a.x > a.y ? a.x : a.y;
  return xy > a.z ? xy : a.z;
}
inline bool is_finite(Vec3f a) {
  constexpr float kMost = 3e38f;
  return a.x >= -kMost && a.x <= kMost && a.y >= -kMost && a.y <= kMost && a.z >= -kMost && a.z <= kMost;
}

}  // namespace texmesh::render
