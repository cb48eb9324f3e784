#pragma once
#include <algorithm>
#include <cmath>
#include <cstdint>

namespace texmesh {

// Fractions 0..1 as multiples of 1 / 65535, rounded to nearest; what is out of range is clamped.

inline std::uint16_t to_unit16(float v) {
  return static_cast<std::uint16_t>(std::floor(std::clamp(v, 0.0f, 1.0f) * 65535.0 + 0.5));
}
inline float from_unit16(std::uint16_t v) { return static_cast<float>(v / 65535.0); }

}  // namespace texmesh
