#pragma once

#include "format/base/vec.h"

namespace texmesh {

/// A 32-bit hash of a lattice point; the source of everything random in a made scan. Integer arithmetic only,
/// so the same on every machine.
inline std::uint32_t hash(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::uint32_t seed) {
  std::uint32_t h = seed * 0x9e3779b1u ^ x * 0x85ebca77u ^ y * 0xc2b2ae3du ^ z * 0x27d4eb2fu;
  h = (h ^ (h >> 15)) * 0x2c1b3c6du;
  h = (h ^ (h >> 12)) * 0x297a2d39u;
  return h ^ (h >> 15);
}
/// [0, 1)
inline double hash01(std::uint32_t x, std::uint32_t y, std::uint32_t z, std::uint32_t seed) {
  return hash(x, y, z, seed) / 4294967296.0;
}

/// Gradient noise over R^3, about -1..1, smooth to the second derivative.
double noise(Vec3d p, std::uint32_t seed);
/// Sum of `octaves` noises, frequency doubling and amplitude times `gain` each time; about -1..1.
double fractal(Vec3d p, std::uint32_t seed, int octaves, double gain = 0.5);
/// As fractal, of 1 - |noise|: crests and veins; about 0..1.
double ridged(Vec3d p, std::uint32_t seed, int octaves, double gain = 0.5);
/// Spots: 1 in the middle of a spot falling to 0 at its rim, 0 between; one spot per lattice cell, of random
/// size.
double spots(Vec3d p, std::uint32_t seed, double density);

inline double mix(double a, double b, double t) { return a + (b - a) * t; }
inline Vec3d mix(Vec3d a, Vec3d b, double t) { return a + (b - a) * t; }
inline double clamp01(double x) { return x < 0 ? 0 : x > 1 ? 1 : x; }
inline double smoothstep(double lo, double hi, double x) {
  const double t = clamp01((x - lo) / (hi - lo));
  return t * t * (3 - 2 * t);
}

}  // namespace texmesh
