#include "stages/render/environment.h"

#include <cstring>

#include "stages/base/parallel.h"
#include "stages/render/render_math.h"

namespace texmesh {
namespace {

using Level = RenderEnvironment::Level;

constexpr std::size_t kHarmonics = RenderEnvironment::kHarmonics;

// By roughness i / 7. The variances are those of three.js r170's prefiltered maps, from what the maps leave
// of the studio's harmonics of bands 1 to 4. With GGX lobes, which are wider, rough metal was 5 of 255 beside
// three.js; so was plaster with irradiance of a cosine.
struct LevelPlan {
  std::uint32_t side;
  std::size_t samples;
  double variance;  // of the angle along each of two axes, radians squared
};
constexpr LevelPlan kLevels[] = {{128, 1, 0},      {64, 96, 0.0008}, {64, 96, 0.0135}, {32, 192, 0.058},
                                 {32, 192, 0.129}, {32, 384, 0.21},  {32, 384, 0.27},  {32, 384, 0.32}};
// What three.js r170's roughest map, from which it reads irradiance, leaves of each band. A cosine lobe over
// pi leaves 1, 2/3, 1/4, 0 and -1/24.
constexpr double kIrradianceOfBand[] = {1, 0.740, 0.391, 0.167, 0.057};

/// A colour and a number that does not matter.
using Quad = float __attribute__((vector_size(16)));
Quad quad_of(const Vec4f& v) {
  Quad q;
  std::memcpy(&q, &v, sizeof q);
  return q;
}
Vec3f colour_of(Quad q) { return {q[0], q[1], q[2]}; }
Vec4f padded(Vec3f c) { return {c.x, c.y, c.z, 0}; }

/// `place`: octahedral().
Quad read_level(const Level& level, Vec2f place) {
  const float scale = static_cast<float>(level.side - 2) * 0.5f;
  // Texel i of a level has its middle at (i - 0.5) / (side - 2) of the square.
  const auto end = static_cast<float>(level.side - 1);
  const float x = clamped((place.x + 1) * scale + 0.5f, 0, end),
              y = clamped((place.y + 1) * scale + 0.5f, 0, end);
  const auto most = static_cast<std::int32_t>(level.side) - 2;
  const std::int32_t column = std::min(floor_of(x), most), row = std::min(floor_of(y), most);
  const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
  const Vec4f* texel =
      level.texels.data() + static_cast<std::size_t>(row) * level.side + static_cast<std::size_t>(column);
  const Quad a = quad_of(texel[0]), b = quad_of(texel[1]), c = quad_of(texel[level.side]),
             d = quad_of(texel[level.side + 1]);
  const Quad top = a + (b - a) * fx, bottom = c + (d - c) * fx;
  return top + (bottom - top) * fy;
}

Level make_level(std::uint32_t inner_side, const RunContext& context, auto value_of) {
  Level level;
  level.side = inner_side + 2;
  level.texels.resize(static_cast<std::size_t>(level.side) * level.side);
  parallel_each(context, level.texels.size(), 256, [&](std::size_t i) {
    auto place = [&](std::size_t at) {
      return (static_cast<float>(at) - 0.5f) * 2 / static_cast<float>(inner_side) - 1;
    };
    const Vec3f value = value_of(octahedral_direction({place(i % level.side), place(i / level.side)}));
    level.texels[i] =
        padded({clamped(value.x, 0, 65504), clamped(value.y, 0, 65504), clamped(value.z, 0, 65504)});
  });
  return level;
}

struct LobeSample {
  Vec3f direction;  // around +z
  float weight = 0;
};

/// A Gaussian of the angle by equal shares; each sample counts by the sphere's area beside the plane's.
std::vector<LobeSample> lobe_samples(const LevelPlan& plan) {
  std::vector<LobeSample> out;
  double sum = 0;
  for (std::size_t i = 0; i < plan.samples; ++i) {
    double radical = 0, digit = 0.5;
    for (std::size_t n = i; n > 0; n /= 2, digit /= 2) radical += static_cast<double>(n % 2) * digit;
    const double share = (static_cast<double>(i) + 0.5) / static_cast<double>(plan.samples);
    const double fall = std::sqrt(-2 * plan.variance * portable::log(1 - share));
    if (fall >= portable::kPi) continue;
    const double ring = portable::sin(fall), turn = 2 * portable::kPi * radical, weight = ring / fall;
    out.push_back(
        {to_float(Vec3d{ring * portable::cos(turn), ring * portable::sin(turn), portable::cos(fall)}),
         static_cast<float>(weight)});
    sum += weight;
  }
  for (LobeSample& s : out) s.weight = static_cast<float>(static_cast<double>(s.weight) / sum);
  return out;
}

Vec3f filtered(const Level& radiance, const std::vector<LobeSample>& lobe, Vec3f z) {
  // Any pair of axes serves; this one has no seam near the poles.
  const Vec3f x = normalized(cross(z.y < 0.9f && z.y > -0.9f ? Vec3f{0, 1, 0} : Vec3f{1, 0, 0}, z));
  const Vec3f y = cross(z, x);
  Quad sum{};
  for (const LobeSample& s : lobe)
    sum += read_level(radiance, octahedral(x * s.direction.x + y * s.direction.y + z * s.direction.z)) *
           s.weight;
  return colour_of(sum);
}

/// Real spherical harmonics of the bands 0 to 4.
template <class T>
std::array<T, kHarmonics> harmonics_of(Vec3<T> d) {
  using Number = std::conditional_t<std::same_as<T, double>, double, float>;
  const auto n = [](double number) { return static_cast<Number>(number); };
  const T x = d.x, y = d.y, z = d.z, x2 = x * x, y2 = y * y, z2 = z * z;
  return {T{} + n(0.28209479177387814),
          n(0.48860251190291992) * y,
          n(0.48860251190291992) * z,
          n(0.48860251190291992) * x,
          n(1.0925484305920792) * x * y,
          n(1.0925484305920792) * y * z,
          n(0.31539156525252005) * (3 * z2 - 1),
          n(1.0925484305920792) * x * z,
          n(0.54627421529603959) * (x2 - y2),
          n(0.59004358992664352) * y * (3 * x2 - y2),
          n(2.8906114426405538) * x * y * z,
          n(0.45704579946446572) * y * (5 * z2 - 1),
          n(0.37317633259011540) * z * (5 * z2 - 3),
          n(0.45704579946446572) * x * (5 * z2 - 1),
          n(1.4453057213202769) * z * (x2 - y2),
          n(0.59004358992664352) * x * (x2 - 3 * y2),
          n(2.5033429417967046) * x * y * (x2 - y2),
          n(1.7701307697799304) * y * z * (3 * x2 - y2),
          n(0.94617469575756008) * x * y * (7 * z2 - 1),
          n(0.66904654355728921) * y * z * (7 * z2 - 3),
          n(0.10578554691520431) * (35 * z2 * z2 - 30 * z2 + 3),
          n(0.66904654355728921) * x * z * (7 * z2 - 3),
          n(0.47308734787878004) * (x2 - y2) * (7 * z2 - 1),
          n(1.7701307697799304) * x * z * (x2 - 3 * y2),
          n(0.62583573544917614) * (x2 * x2 - 6 * x2 * y2 + y2 * y2)};
}

template <Float F>
Vec3<F> irradiance_at(const RenderEnvironment& environment, Vec3<F> normal) {
  const std::array<F, kHarmonics> basis = harmonics_of(normal);
  Vec3<F> sum;
  for (std::size_t k = 0; k < kHarmonics; ++k) {
    const Vec4f& light = environment.irradiance[k];
    sum = sum + Vec3<F>{light.x * basis[k], light.y * basis[k], light.z * basis[k]};
  }
  return {clamped(sum.x, 0, 65504), clamped(sum.y, 0, 65504), clamped(sum.z, 0, 65504)};
}

/// `place`: octahedral().
Quad lobe_at(const RenderEnvironment& environment, Vec2f place, float roughness) {
  const float at = saturated(roughness) * static_cast<float>(environment.levels.size() - 1);
  const auto sharp = std::min(static_cast<std::size_t>(at), environment.levels.size() - 2);
  const Quad a = read_level(environment.levels[sharp], place),
             b = read_level(environment.levels[sharp + 1], place);
  return a + (b - a) * (at - static_cast<float>(sharp));
}

std::array<Vec4f, kHarmonics> irradiance_of(const Radiance& radiance) {
  constexpr int kRings = 64, kPlaces = 128;
  std::array<Vec3d, kHarmonics> sum{};
  for (int i = 0; i < kRings; ++i) {
    // Rings of equal area
    const double up = 1 - 2 * (i + 0.5) / kRings, ring = std::sqrt(1 - up * up);
    for (int j = 0; j < kPlaces; ++j) {
      const double angle = 2 * portable::kPi * (j + 0.5) / kPlaces;
      const Vec3d d{ring * portable::cos(angle), up, ring * portable::sin(angle)};
      const Vec3f light = radiance(to_float(d));
      const std::array<double, kHarmonics> basis = harmonics_of(d);
      for (std::size_t k = 0; k < kHarmonics; ++k)
        for (int c = 0; c < 3; ++c) sum[k][c] += basis[k] * static_cast<double>(clamped(light[c], 0, 65504));
    }
  }
  std::array<Vec4f, kHarmonics> out;
  for (std::size_t k = 0; k < kHarmonics; ++k) {
    const double weight = kIrradianceOfBand[k == 0 ? 0 : k < 4 ? 1 : k < 9 ? 2 : k < 16 ? 3 : 4];
    out[k] = padded(to_float(sum[k] * (4 * portable::kPi / (kRings * kPlaces) * weight)));
  }
  return out;
}

/// A soft box: a lobe exp(sharpness (cos - 1)) around a direction.
struct SoftBox {
  Vec3f direction;  // not unit
  float sharpness;
  Vec3f peak;
};

// Their sum is grey. The main box stands where the key light comes from.
constexpr SoftBox kBoxes[] = {{{0.62f, 0.72f, 0.55f}, 26, {4.6f, 4.5f, 4.35f}},
                              {{-0.85f, 0.35f, 0.45f}, 14, {1.15f, 1.2f, 1.3f}},
                              {{-0.15f, 0.45f, -0.9f}, 18, {2.15f, 2.2f, 2.3f}}};
constexpr Vec3f kZenith{0.33f, 0.35f, 0.39f}, kHorizon{0.45f, 0.44f, 0.43f}, kGround{0.255f, 0.235f, 0.205f};
constexpr float kLog2E = 1.44269504f;

constexpr std::uint32_t kSkySide = 32, kSkyLevels = 8;

/// As daylight.ts has it: rough surfaces see the hemisphere, mirrors a sky with more contrast.
Vec3f sky_radiance(float up, float roughness) {
  const float t = saturated((up - kMirrorFrom) / kMirrorWidth);
  const float mirrored = kMirrorLow + kMirrorRise * (t * t * (3 - 2 * t));
  const Vec3f paper = kPaperBelow + (kPaperAbove - kPaperBelow) * (0.5f + 0.5f * up);
  return Vec3f{mirrored, mirrored, mirrored} * (1 - roughness) + paper * roughness;
}

float lobe(Vec3f direction, Vec3f axis, float sharpness) {
  return exp2_of(kLog2E * sharpness * (dot(direction, normalized(axis)) - 1));
}

}  // namespace

RenderEnvironment prepare_environment(const Radiance& radiance, const KeyLight& key,
                                      const RunContext& context) {
  RenderEnvironment out;
  out.key = key;
  out.irradiance = irradiance_of(radiance);
  out.levels.push_back(make_level(kLevels[0].side, context, radiance));
  for (std::size_t i = 1; i < std::size(kLevels); ++i) {
    const std::vector<LobeSample> lobe = lobe_samples(kLevels[i]);
    out.levels.push_back(make_level(kLevels[i].side, context, [&](Vec3f direction) {
      return filtered(out.levels.front(), lobe, direction);
    }));
  }
  return out;
}

Vec3f diffuse_light(const RenderEnvironment& environment, Vec3f normal) {
  return irradiance_at(environment, normal);
}
Vec3<Lanes> diffuse_light(const RenderEnvironment& environment, Vec3<Lanes> normal) {
  return irradiance_at(environment, normal);
}

Vec3f specular_light(const RenderEnvironment& environment, Vec3f direction, float roughness) {
  if (environment.levels.empty()) return {};
  return colour_of(lobe_at(environment, octahedral(direction), roughness));
}
Vec3<Lanes> specular_light(const RenderEnvironment& environment, Vec3<Lanes> direction, Lanes roughness) {
  Vec3<Lanes> out;
  if (environment.levels.empty()) return out;
  const Vec2<Lanes> place = octahedral(direction);
  for (std::size_t i = 0; i < kLanes; ++i) {
    const Quad c = lobe_at(environment, {place.x[i], place.y[i]}, roughness[i]);
    out.x[i] = c[0], out.y[i] = c[1], out.z[i] = c[2];
  }
  return out;
}

Vec3f studio_radiance(Vec3f direction) {
  const float up = clamped(direction.y, -1, 1);
  // The sky turns into the ground within about 20 degrees around the horizon.
  const float t = saturated((up + 0.18f) / 0.36f), sky = t * t * (3 - 2 * t);
  const float high = saturated(up);
  const Vec3f above = kHorizon + (kZenith - kHorizon) * high;
  Vec3f sum = kGround + (above - kGround) * sky;
  for (const SoftBox& box : kBoxes) sum = sum + box.peak * lobe(direction, box.direction, box.sharpness);
  return sum;
}

RenderEnvironment daylight_environment(Vec3f x, Vec3f y, Vec3f z, bool metallic) {
  RenderEnvironment out{};
  // A hemisphere's irradiance is linear in the height of the normal: bands 0 and 1 hold it.
  const std::array<float, kHarmonics> basis = harmonics_of(Vec3f{0, 1, 0});
  out.irradiance[0] = padded((kPaperAbove + kPaperBelow) * (0.5f / basis[0]));
  out.irradiance[1] = padded((kPaperAbove - kPaperBelow) * (0.5f / basis[1]));
  for (std::uint32_t i = 0; metallic && i < kSkyLevels; ++i) {
    const float roughness = static_cast<float>(i) / (kSkyLevels - 1);
    out.levels.push_back(
        make_level(kSkySide, {}, [&](Vec3f direction) { return sky_radiance(direction.y, roughness); }));
  }
  out.key = {normalized(x * kLampPlace.x + y * kLampPlace.y + z * kLampPlace.z),
             Vec3f{kLampIntensity, kLampIntensity, kLampIntensity}};
  return out;
}

KeyLight studio_key_light() { return {normalized(Vec3f{0.62f, 0.72f, 0.55f}), Vec3f{1.02f, 1.0f, 0.96f}}; }

}  // namespace texmesh
