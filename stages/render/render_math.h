#pragma once
// Inside the room only: functions of shading with the same bits on every machine.
#include "format/base/srgb.h"
#include "format/base/vec.h"
#include "stages/base/float_math.h"

namespace texmesh {

inline constexpr float kFloatPi = 3.14159265358979323846f;

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

/// -1..1 in both; |x| + |y| > 1 is the lower half, y < 0. The vector need not be unit; of no direction the
/// place is the middle.
inline Vec2f octahedral(Vec3f d) {
  auto size = [](float v) { return v < 0 ? -v : v; };
  const float sum = size(d.x) + size(d.y) + size(d.z);
  const float scale = sum > 0 ? 1 / sum : 0;
  const float x = d.x * scale, y = d.z * scale;
  if (d.y >= 0) return {x, y};
  return {(1 - size(y)) * (x < 0 ? -1.f : 1.f), (1 - size(x)) * (y < 0 ? -1.f : 1.f)};
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

/// Light as the nearest sRGB code of 8 bits; what lies beyond 0..1 is cut off.
class SrgbEncoder {
 public:
  SrgbEncoder() {
    std::size_t code = 0;
    for (std::size_t i = 0; i <= kSteps; ++i) {
      while (code < 255 && static_cast<double>(i) / kSteps >= border(code)) ++code;
      first_[i] = static_cast<std::uint8_t>(code);
    }
    for (std::size_t c = 0; c < 255; ++c) border_[c] = static_cast<float>(border(c));
    border_[255] = 2;  // above all light
  }
  std::uint8_t operator()(float light) const {
    const float within = clamped(light, 0, 1);
    std::uint8_t code = first_[static_cast<std::size_t>(within * kSteps)];
    while (within >= border_[code]) ++code;
    return code;
  }

 private:
  static constexpr std::size_t kSteps = 4096;  // below the steepest steps of two codes
  /// Light between the codes c and c + 1.
  static double border(std::size_t c) { return light_of_srgb((static_cast<double>(c) + 0.5) / 255); }
  std::array<std::uint8_t, kSteps + 1> first_{};
  std::array<float, 256> border_{};
};

/// One for all; the same on every machine.
inline const SrgbEncoder& srgb_encoder() {
  static const SrgbEncoder encoder;
  return encoder;
}

}  // namespace texmesh
