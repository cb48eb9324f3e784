#include "examples/scan_model.h"
#include "examples/scan_noise.h"
#include "format/base/portable_math.h"

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

/// The lattice cell that a point lies in, and where.
struct LatticeCell {
  std::uint32_t x, y, z;
  Vec3d at;
  explicit LatticeCell(Vec3d p) {
    const Vec3d low{std::floor(p.x), std::floor(p.y), std::floor(p.z)};
    const auto number = [](double v) { return static_cast<std::uint32_t>(static_cast<std::int64_t>(v)); };
    x = number(low.x), y = number(low.y), z = number(low.z);
    at = p - low;
  }
};

/// The sum of `of` each octave's noise, and the sum of their amplitudes.
template <class Of>
std::pair<double, double> octave_sum(Vec3d p, std::uint32_t seed, int octaves, double gain, const Of& of) {
  double sum = 0, amplitude = 1, total = 0;
  for (int i = 0; i < octaves; ++i) {
    sum += amplitude * of(noise(p, seed + static_cast<std::uint32_t>(i)));
    total += amplitude;
    amplitude *= gain;
    p = next_octave(p);
  }
  return {sum, total};
}

constexpr double kUnit = 0.11;  // object units of a radius of 1

// Terracotta, weathered bronze, limestone, painted wood: ground, second ground, growth, dirt.
constexpr Vec3d kPalettes[4][4] = {
    {{0.69, 0.43, 0.30}, {0.80, 0.58, 0.42}, {0.47, 0.42, 0.30}, {0.28, 0.20, 0.16}},
    {{0.38, 0.33, 0.22}, {0.50, 0.40, 0.25}, {0.36, 0.53, 0.46}, {0.14, 0.13, 0.11}},
    {{0.76, 0.72, 0.63}, {0.63, 0.60, 0.54}, {0.52, 0.53, 0.36}, {0.30, 0.28, 0.25}},
    {{0.55, 0.22, 0.16}, {0.25, 0.34, 0.42}, {0.72, 0.62, 0.42}, {0.22, 0.16, 0.12}},
};

Vec3d random_direction(std::uint32_t index, std::uint32_t seed) {
  const double y = 2 * hash01(index, 1, 0, seed) - 1, angle = 2 * portable::kPi * hash01(index, 2, 0, seed);
  const double r = std::sqrt(1 - y * y);
  return {r * portable::cos(angle), y, r * portable::sin(angle)};
}

}  // namespace

double noise(Vec3d p, std::uint32_t seed) {
  const LatticeCell cell(p);
  const auto [x, y, z] = cell.at;
  const double u = fade(x), v = fade(y), w = fade(z);
  auto corner = [&](std::uint32_t i, std::uint32_t j, std::uint32_t k) {
    const Vec3d& at = cell.at;
    return gradient(hash(cell.x + i, cell.y + j, cell.z + k, seed), at.x - i, at.y - j, at.z - k);
  };
  const double a = mix(mix(corner(0, 0, 0), corner(1, 0, 0), u), mix(corner(0, 1, 0), corner(1, 1, 0), u), v);
  const double b = mix(mix(corner(0, 0, 1), corner(1, 0, 1), u), mix(corner(0, 1, 1), corner(1, 1, 1), u), v);
  return mix(a, b, w);
}

double fractal(Vec3d p, std::uint32_t seed, int octaves, double gain) {
  return octave_sum(p, seed, octaves, gain, [](double x) { return x; }).first;
}

double ridged(Vec3d p, std::uint32_t seed, int octaves, double gain) {
  const auto [sum, amplitudes] =
      octave_sum(p, seed, octaves, gain, [](double x) { return 1 - std::fabs(x); });
  return sum / amplitudes;
}

double spots(Vec3d p, std::uint32_t seed, double density) {
  const LatticeCell cell(p);
  const auto drawn = [&](std::uint32_t k) { return hash01(cell.x, cell.y, cell.z, seed + k); };
  if (drawn(0) >= density) return 0;
  // Radius and centre are such that a spot never leaves its cell: one cell to look at instead of 27.
  const double radius = 0.12 + 0.34 * drawn(1);
  auto centre = [&](std::uint32_t k) { return radius + (1 - 2 * radius) * drawn(k); };
  const Vec3d d{cell.at.x - centre(2), cell.at.y - centre(3), cell.at.z - centre(4)};
  return std::max(0.0, 1 - length(d) / radius);
}

RockShape::RockShape(std::uint32_t seed) : seed_(seed * 1000003u + 17u) {
  twist_ = mix(-0.6, 0.6, hash01(1, 0, 0, seed_));
  bend_ = mix(-0.18, 0.18, hash01(2, 0, 0, seed_));
  stretch_ = mix(1.15, 1.5, hash01(3, 0, 0, seed_));
  const std::uint32_t lobes = 5 + hash(4, 0, 0, seed_) % 5;
  for (std::uint32_t i = 0; i < lobes; ++i)
    lobes_.push_back({random_direction(i, seed_), mix(-0.18, 0.42, hash01(i, 5, 0, seed_)),
                      mix(4, 22, hash01(i, 6, 0, seed_))});
  const std::uint32_t palette = hash(7, 0, 0, seed_) % 4;
  std::copy_n(kPalettes[palette], 4, palette_.begin());
}

double RockShape::radius(Vec3d d) const {
  double r = 1 + 0.28 * fractal(d * 1.4, seed_ + 10, 3);
  for (const Lobe& lobe : lobes_) r += lobe.size * portable::exp((dot(d, lobe.centre) - 1) * lobe.sharpness);
  r += 0.05 * fractal(d * 4.5, seed_ + 20, 4);
  const double crest = ridged(d * 9, seed_ + 30, 3);
  return r + 0.035 * crest * crest * crest * smoothstep(-0.1, 0.3, noise(d * 2, seed_ + 40));
}

Vec3d RockShape::point(Vec3d d) const {
  const Vec3d p = d * std::max(0.25, radius(d));
  const double y = p.y * stretch_, angle = twist_ * y;
  const double c = portable::cos(angle), s = portable::sin(angle);
  return Vec3d{c * p.x - s * p.z + bend_ * y * y, y, s * p.x + c * p.z} * kUnit;
}

double RockShape::range_radius(double alpha, double t) const {
  const Vec3d around{portable::cos(alpha), 2.2 * t, portable::sin(alpha)};
  // A bust's outline: shoulders, neck, head.
  const double outline = 0.10 - 0.055 * smoothstep(0.15, 0.35, t) + 0.035 * smoothstep(0.42, 0.6, t) -
                         0.045 * smoothstep(0.8, 1.0, t);
  const double relief =
      0.20 * fractal(around * 1.1, seed_ + 10, 3) + 0.05 * fractal(around * 5, seed_ + 20, 5);
  return outline * std::max(0.3, 1 + relief);
}

ShapeSample RockShape::sample(Vec3d position, Vec3d normal, double finest) const {
  const Vec3d p = position * (1 / kUnit);
  const Vec3d q = p + Vec3d{fractal(p * 1.7, seed_ + 50, 3), fractal(p * 1.7, seed_ + 53, 3),
                            fractal(p * 1.7, seed_ + 56, 3)} *
                          0.3;
  // Detail follows 1/f down to two texels, as photographs of rough things do.
  const int octaves =
      std::clamp(static_cast<int>(portable::log(kUnit / (2 * 6.0 * finest)) / portable::log(2.0)), 2, 10);
  const double fine = fractal(p * 6, seed_ + 60, octaves, 0.62);
  const double grain = fractal(p * (kUnit / (4.5 * finest)), seed_ + 75, 2, 0.9);
  const double growth = smoothstep(0.12, 0.30, fractal(q * 2.3, seed_ + 80, 5) + 0.12 * fine);
  const double crack = ridged(q * 3.1, seed_ + 90, 4);
  const double cracks = smoothstep(0.905, 0.965, crack);
  const double drip = smoothstep(0.15, 0.5, fractal({p.x * 5, p.y * 0.7, p.z * 5}, seed_ + 100, 4)) *
                      smoothstep(-0.8, 0.3, p.y);
  const double pits = spots(p * 22, seed_ + 110, 0.5), flecks = spots(p * 55, seed_ + 120, 0.35);

  Vec3d c = mix(palette_[0], palette_[1], smoothstep(-0.35, 0.35, fractal(q * 1.1, seed_ + 130, 4)));
  c = mix(c, palette_[2], 0.8 * growth);
  c = c * (1 + 0.26 * fine + 0.09 * grain);
  c = c + Vec3d{0.05, 0.01, -0.04} * fractal(p * 3, seed_ + 140, 3);
  c = mix(c, palette_[3], 0.55 * drip);
  c = mix(c, palette_[3] * 0.7, 0.75 * cracks);
  c = mix(c, palette_[3], 0.6 * smoothstep(0, 0.5, pits));
  c = mix(c, Vec3d{0.86, 0.84, 0.78}, 0.45 * smoothstep(0.2, 0.6, flecks) * (1 - growth));

  ShapeSample s;
  s.height = kUnit * (0.010 * fine - 0.012 * cracks - 0.010 * smoothstep(0, 0.7, pits) + 0.006 * growth);
  s.occlusion = clamp01(1 - 0.5 * cracks - 0.35 * smoothstep(0, 0.7, pits) + 0.15 * std::min(0.0, fine));
  s.roughness = clamp01(0.62 + 0.2 * growth + 0.12 * fine - 0.25 * drip);
  // The light of the day on which the photographs were taken: soft, from above, baked in.
  const double light = 0.80 + 0.20 * dot(normal, normalized(Vec3d{0.35, 0.85, 0.4}));
  s.colour = c * (light * (0.6 + 0.4 * s.occlusion));
  return s;
}

}  // namespace texmesh
