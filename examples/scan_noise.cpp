#include "examples/scan_noise.h"

#include <algorithm>

namespace texmesh {
namespace {

double fade(double t) { return t * t * t * (t * (t * 6 - 15) + 10); }

// The dot product of one of twelve edge directions of a cube with (x, y, z).
double gradient(std::uint32_t h, double x, double y, double z) {
  const std::uint32_t g = h >> 28;
  const double u = g < 8 ? x : y, v = g < 4 ? y : (g == 12 || g == 14) ? x : z;
  return ((g & 1) ? -u : u) + ((g & 2) ? -v : v);
}

// Octaves are shifted against each other so that their lattices never line up.
Vec3d next_octave(Vec3d p) { return {p.x * 2 + 17.31, p.y * 2 - 9.57, p.z * 2 + 5.13}; }

}  // namespace

double noise(Vec3d p, std::uint32_t seed) {
  const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
  const double x = p.x - fx, y = p.y - fy, z = p.z - fz;
  const auto ix = static_cast<std::uint32_t>(static_cast<std::int64_t>(fx));
  const auto iy = static_cast<std::uint32_t>(static_cast<std::int64_t>(fy));
  const auto iz = static_cast<std::uint32_t>(static_cast<std::int64_t>(fz));
  const double u = fade(x), v = fade(y), w = fade(z);
  auto corner = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    return gradient(hash(ix + i, iy + j, iz + k, seed), x - i, y - j, z - k);
  };
  const double a = mix(mix(corner(0, 0, 0), corner(1, 0, 0), u), mix(corner(0, 1, 0), corner(1, 1, 0), u), v);
  const double b = mix(mix(corner(0, 0, 1), corner(1, 0, 1), u), mix(corner(0, 1, 1), corner(1, 1, 1), u), v);
  return mix(a, b, w);
}

double fractal(Vec3d p, std::uint32_t seed, int octaves, double gain) {
  double sum = 0, amplitude = 1;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * noise(p, seed + static_cast<std::uint32_t>(i));
    amplitude *= gain;
    p = next_octave(p);
  }
  return sum;
}

double ridged(Vec3d p, std::uint32_t seed, int octaves, double gain) {
  double sum = 0, amplitude = 1, total = 0;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * (1 - std::fabs(noise(p, seed + static_cast<std::uint32_t>(i))));
    total += amplitude;
    amplitude *= gain;
    p = next_octave(p);
  }
  return sum / total;
}

double spots(Vec3d p, std::uint32_t seed, double density) {
  const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
  const auto ix = static_cast<std::uint32_t>(static_cast<std::int64_t>(fx));
  const auto iy = static_cast<std::uint32_t>(static_cast<std::int64_t>(fy));
  const auto iz = static_cast<std::uint32_t>(static_cast<std::int64_t>(fz));
  if (hash01(ix, iy, iz, seed) >= density) return 0;
  // Radius and centre are such that a spot never leaves its cell: one cell to look at instead of 27.
  const double radius = 0.12 + 0.34 * hash01(ix, iy, iz, seed + 1);
  auto centre = [&](std::uint32_t k) { return radius + (1 - 2 * radius) * hash01(ix, iy, iz, seed + k); };
  const Vec3d d{p.x - fx - centre(2), p.y - fy - centre(3), p.z - fz - centre(4)};
  return std::max(0.0, 1 - length(d) / radius);
}

}  // namespace texmesh
