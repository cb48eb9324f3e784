#pragma once
#include <array>

namespace texmesh {

// exp, log, sin, cos, atan2, pow with the same bits on every x86-64 machine: libm picks fused-multiply-add
// variants at run time, whose last bits differ. Plain double arithmetic only; about 1e-15 relative. What
// reaches a package or a cache goes through these (std::sqrt is correctly rounded and fine as it is).
namespace portable {
double exp(double x);
double log(double x);  // x > 0
double sin(double x);  // |x| <= 1e6
double cos(double x);  // |x| <= 1e6
double atan2(double y, double x);
double pow(double base, double exponent);  // base > 0
inline constexpr double kPi = 3.14159265358979323846, kLn2 = 0.693147180559945309417;
}  // namespace portable

// The transfer curve of sRGB (IEC 61966-2-1), 0..1 on both sides; the same bits on every machine.

inline double light_of_srgb(double code) {
  return code <= 0.04045 ? code / 12.92 : portable::pow((code + 0.055) / 1.055, 2.4);
}
inline double srgb_of_light(double light) {
  return light <= 0.0031308 ? 12.92 * light : 1.055 * portable::pow(light, 1 / 2.4) - 0.055;
}
/// Light of the 256 codes of a byte.
inline const std::array<float, 256>& light_of_bytes() {
  static const std::array<float, 256> table = [] {
    std::array<float, 256> t{};
    for (std::size_t i = 0; i < t.size(); ++i)
      t[i] = static_cast<float>(light_of_srgb(static_cast<double>(i) / 255));
    return t;
  }();
  return table;
}

}  // namespace texmesh
