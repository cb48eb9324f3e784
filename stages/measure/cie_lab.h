#pragma once
// Colours as the eye tells them apart, for FLIP (Andersson et al. 2020) and for seams. Linear colours are
// those of sRGB's primaries, 0 .. 1; XYZ is relative to a white of Y = 1.

#include "format/base/portable_math.h"
#include "format/base/vec.h"

namespace texmesh {

/// D65, as FLIP has it.
inline constexpr Vec3d kWhiteXyz{0.950428545, 1.0, 1.088900371};

inline Vec3d xyz_of_linear(Vec3f c) {
  return {0.4124564 * c.x + 0.3575761 * c.y + 0.1804375 * c.z,
          0.2126729 * c.x + 0.7151522 * c.y + 0.0721750 * c.z,
          0.0193339 * c.x + 0.1191920 * c.y + 0.9503041 * c.z};
}
inline Vec3f linear_of_xyz(Vec3d c) {
  return {static_cast<float>(3.2404542 * c.x - 1.5371385 * c.y - 0.4985314 * c.z),
          static_cast<float>(-0.9692660 * c.x + 1.8760108 * c.y + 0.0415560 * c.z),
          static_cast<float>(0.0556434 * c.x - 0.2040259 * c.y + 1.0572252 * c.z)};
}
inline Vec3f clamped_colour(Vec3f c) {
  return {std::clamp(c.x, 0.f, 1.f), std::clamp(c.y, 0.f, 1.f), std::clamp(c.z, 0.f, 1.f)};
}

/// Y, Cx, Cz: the linear counterpart of L*a*b*, in which the eye's filters work.
inline Vec3d opponent_of_xyz(Vec3d c) {
  const double x = c.x / kWhiteXyz.x, z = c.z / kWhiteXyz.z;
  return {116 * c.y - 16, 500 * (x - c.y), 200 * (c.y - z)};
}
inline Vec3d xyz_of_opponent(Vec3d c) {
  const double y = (c.x + 16) / 116;
  return {(y + c.y / 500) * kWhiteXyz.x, y, (y - c.z / 200) * kWhiteXyz.z};
}

/// The cube root of L*a*b*, a straight line near 0.
inline double lab_root(double x) {
  return x > 216.0 / 24389 ? portable::pow(x, 1.0 / 3) : (841.0 / 108) * x + 4.0 / 29;
}

/// XYZ, white as 1.
inline Vec3f over_white(Vec3d xyz) {
  return {static_cast<float>(xyz.x / kWhiteXyz.x), static_cast<float>(xyz.y),
          static_cast<float>(xyz.z / kWhiteXyz.z)};
}
/// L*a*b* of what over_white() gives, with colours counting for less in the dark (Hunt). `root`: lab_root(),
/// or samples of it.
Vec3f hunt_lab_of(Vec3f relative, const auto& root) {
  const float fx = root(relative.x), fy = root(relative.y), fz = root(relative.z);
  const float lightness = 116 * fy - 16, share = 0.01f * lightness;
  return {lightness, share * 500 * (fx - fy), share * 200 * (fy - fz)};
}
Vec3f hunt_lab(Vec3d xyz, const auto& root) { return hunt_lab_of(over_white(xyz), root); }

/// HyAB, the distance of two colours in L*a*b* that suits large differences, too.
template <class T>
T hyab(Vec3f a, Vec3f b) {
  const Vec3f d = a - b;
  return std::fabs(static_cast<T>(d.x)) + std::sqrt(static_cast<T>(d.y * d.y + d.z * d.z));
}

/// The HyAB distance of green and blue, the largest that FLIP knows.
template <class T, class Root>
T largest_hyab(const Root& root) {
  return hyab<T>(hunt_lab(xyz_of_linear({0, 1, 0}), root), hunt_lab(xyz_of_linear({0, 0, 1}), root));
}

/// FLIP's exponent of distances.
inline constexpr double kHyabExponent = 0.7;

/// 0 .. 1, of which small differences get nearly all. `power`: a distance with FLIP's exponent, `largest`:
/// the largest distance with it.
template <class T>
T remapped_difference(T power, T largest) {
  constexpr auto kKnee = static_cast<T>(0.4), kTop = static_cast<T>(0.95);
  const T knee = kKnee * largest;
  // Both lines, so that compilers may take several values at once.
  const T below = kTop / knee * power, above = kTop + (power - knee) / (largest - knee) * (1 - kTop);
  return std::min(T{1}, power < knee ? below : above);
}

}  // namespace texmesh
