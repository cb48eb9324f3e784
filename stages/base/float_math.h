#pragma once
// Functions of single precision with the same bits on every machine, of one value or of several at once.
#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <concepts>
#include <cstdint>

#include "format/base/portable_math.h"

namespace texmesh {

/// Several floats at once, as many as every processor takes. What is written for F takes a float or Lanes,
/// and gives a lane the bits that it gives a float.
using Lanes = float __attribute__((vector_size(16)));
using LaneInts = std::int32_t __attribute__((vector_size(16)));
inline constexpr std::size_t kLanes = 4;
template <class F>
concept Float = std::same_as<F, float> || std::same_as<F, Lanes>;

/// Whole numbers of the sizes of F, and F of them. Towards 0; |x| < 2^31.
inline std::int32_t whole_of(float x) { return static_cast<std::int32_t>(x); }
inline LaneInts whole_of(Lanes x) { return __builtin_convertvector(x, LaneInts); }
inline float number_of(std::int32_t i) { return static_cast<float>(i); }
inline Lanes number_of(LaneInts i) { return __builtin_convertvector(i, Lanes); }

/// Whether it is so in any lane.
inline bool any(bool is) { return is; }
inline bool any(LaneInts is) {
  const auto halves = std::bit_cast<std::array<std::uint64_t, 2>>(is);
  return (halves[0] | halves[1]) != 0;
}
inline float root_of(float x) { return std::sqrt(x); }
inline Lanes root_of(Lanes x) {
  return Lanes{std::sqrt(x[0]), std::sqrt(x[1]), std::sqrt(x[2]), std::sqrt(x[3])};
}

/// NaN becomes `low`.
template <Float F>
F clamped(F x, float low, float high) {
  const F above = x > low ? x : low;
  return above < high ? above : high;
}
/// The largest integer that is not above x; |x| < 2^31.
inline std::int32_t floor_of(float x) {
  const std::int32_t i = whole_of(x);
  return i - (x < number_of(i) ? 1 : 0);
}
inline LaneInts floor_of(Lanes x) {
  const LaneInts i = whole_of(x);
  return i + (x < number_of(i));  // true is -1
}

/// Within 1e-6 for a normal x > 0: the series of atanh around the mantissa nearest to 1.
template <Float F>
F log2_of(F x) {
  using Ints = decltype(whole_of(x));
  const Ints bits = std::bit_cast<Ints>(x);
  // 0x3f3504f3 is sqrt(1/2): the mantissa comes to lie between sqrt(1/2) and sqrt(2).
  const Ints exponent = (bits - 0x3f3504f3) >> 23;
  const F m = std::bit_cast<F>(bits - (exponent << 23));
  const F t = (m - 1) / (m + 1), t2 = t * t;
  return number_of(exponent) + 2.88539008f * t * (1 + t2 * (0.333333333f + t2 * (0.2f + t2 * 0.142857143f)));
}

/// Within 3e-7 of the value for -126 <= x <= 126; x beyond is cut off, NaN counts as -126.
template <Float F>
F exp2_of(F x) {
  const F at = clamped(x, -126, 126);
  const auto whole = floor_of(at + 0.5f);
  const F f = (at - number_of(whole)) * 0.693147181f;
  const F value =
      1 + f * (1 + f * (0.5f + f * (0.166666667f +
                                    f * (0.0416666667f + f * (0.00833333333f + f * 0.00138888889f)))));
  return value * std::bit_cast<F>((whole + 127) << 23);
}

/// A function of 0 .. 1 by linear interpolation between kSteps + 1 samples.
template <int kSteps>
class SampledCurve {
 public:
  template <class F>
  explicit SampledCurve(F f) {
    for (std::size_t i = 0; i < table_.size(); ++i)
      table_[i] = static_cast<float>(f(static_cast<double>(i) / kSteps));
  }
  float operator()(float x) const {
    const float at = std::clamp(x, 0.f, 1.f) * kSteps;
    const auto i = std::min(static_cast<std::size_t>(at), static_cast<std::size_t>(kSteps - 1));
    return table_[i] + (table_[i + 1] - table_[i]) * (at - static_cast<float>(i));
  }

 private:
  std::array<float, kSteps + 1> table_;
};

/// Light as the nearest sRGB code of 8 bits, as exactly as with the formula, by a table; what lies beyond
/// 0..1 is cut off, NaN is 0. kLowerAtBorder: light in the very middle between two codes gets the lower one.
template <class Real, bool kLowerAtBorder>
class SrgbEncoder {
 public:
  SrgbEncoder() {
    for (std::size_t c = 0; c < 255; ++c)
      border_[c] = static_cast<Real>(light_of_srgb((static_cast<double>(c) + 0.5) / 255));
    border_[255] = 2;  // above all light
    std::uint8_t code = 0;
    for (std::size_t i = 0; i <= kSteps; ++i)
      first_[i] = code = code_from(code, static_cast<Real>(i) / kSteps);
  }
  std::uint8_t operator()(Real light) const {
    if (!(light > 0)) return 0;
    if (light >= 1) return 255;
    return code_from(first_[static_cast<std::size_t>(light * kSteps)], light);
  }

 private:
  static constexpr std::size_t kSteps = 4096;  // below the steepest steps of two codes
  std::uint8_t code_from(std::uint8_t code, Real light) const {
    while (kLowerAtBorder ? light > border_[code] : light >= border_[code]) ++code;
    return code;
  }
  std::array<Real, 256> border_{};  // between each code and the next
  std::array<std::uint8_t, kSteps + 1> first_{};
};

}  // namespace texmesh
