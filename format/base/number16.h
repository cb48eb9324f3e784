#pragma once
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdint>

namespace texmesh {

// IEEE 754 binary16 for finite values >= 0: 11 significant bits (0.05 %) from 6e-5 to 65504, and defined bit
// by bit, where a logarithmic code would need a logarithm that every client rounds alike.

inline constexpr std::uint16_t kLargestHalf = 0x7bff;  // 65504

/// Rounds to nearest, ties to even; `value` must be in 0..65504.
inline std::uint16_t to_half(float value) {
  const std::uint32_t bits = std::bit_cast<std::uint32_t>(value);
  const std::uint32_t exponent = bits >> 23;
  if (exponent < 113) {  // below 2^-14: a multiple of 2^-24
    if (exponent < 102) return 0;
    const std::uint32_t mantissa = (bits & 0x7fffff) | 0x800000, shift = 126 - exponent;
    const std::uint32_t half = 1u << (shift - 1), down = mantissa >> shift,
                        rest = mantissa & ((1u << shift) - 1);
    return static_cast<std::uint16_t>(down + (rest > half || (rest == half && (down & 1)) ? 1 : 0));
  }
  const std::uint32_t rebased = bits - (112u << 23);
  return static_cast<std::uint16_t>((rebased + 0xfff + ((rebased >> 13) & 1)) >> 13);
}

inline float from_half(std::uint16_t half) {
  const std::uint32_t exponent = half >> 10, mantissa = half & 0x3ff;
  if (exponent == 0) return static_cast<float>(mantissa) * 0x1p-24f;
  return std::bit_cast<float>((exponent + 112) << 23 | mantissa << 13);
}

// Fractions 0..1 as multiples of 1 / 65535, rounded to nearest; what is out of range is clamped.

inline std::uint16_t to_unit16(float v) {
  return static_cast<std::uint16_t>(std::floor(std::clamp(v, 0.0f, 1.0f) * 65535.0 + 0.5));
}
inline float from_unit16(std::uint16_t v) { return static_cast<float>(v / 65535.0); }

}  // namespace texmesh
