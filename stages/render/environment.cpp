#include "stages/render/environment.h"

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"
#include "stages/base/parallel.h"
#include "stages/render/octahedron.h"
#include "stages/render/render_math.h"

namespace texmesh {
namespace {

using Level = RenderEnvironment::Level;
using Harmonics = std::array<double, 9>;

constexpr std::uint32_t kSharpSide = 128, kBlurredSide = 64, kBroadSide = 32;
constexpr std::size_t kLevels = 8, kLobeSamples = 128;

Vec3f read_level(const Level& level, Vec3f direction) {
  const Vec2f place = render::octahedral(direction);
  const float scale = static_cast<float>(level.side - 2) * 0.5f;
  // Texel i of a level has its middle at (i - 0.5) / (side - 2) of the square.
  const auto end = static_cast<float>(level.side - 1);
  const float x = render::clamped((place.x + 1) * scale + 0.5f, 0, end),
              y = render::clamped((place.y + 1) * scale + 0.5f, 0, end);
  const auto most = static_cast<std::int32_t>(level.side) - 2;
  const std::int32_t column = std::min(render::floor_of(x), most), row = std::min(render::floor_of(y), most);
  const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
  const Vec3f* texel =
      level.texels.data() + static_cast<std::size_t>(row) * level.side + static_cast<std::size_t>(column);
  const Vec3f top = texel[0] + (texel[1] - texel[0]) * fx;
  const Vec3f bottom = texel[level.side] + (texel[level.side + 1] - texel[level.side]) * fx;
  return top + (bottom - top) * fy;
}

template <class F>
Level make_level(std::uint32_t inner_side, const RunContext& context, F value_of) {
  Level level;
  level.side = inner_side + 2;
  level.texels.resize(static_cast<std::size_t>(level.side) * level.side);
  parallel_for(context, level.texels.size(), 256, [&](std::size_t begin, std::size_t end) {
    for (std::size_t i = begin; i < end; ++i) {
      auto place = [&](std::size_t at) {
        return (static_cast<float>(at) - 0.5f) * 2 / static_cast<float>(inner_side) - 1;
      };
      const Vec3f value =
          value_of(render::octahedral_direction({place(i % level.side), place(i / level.side)}));
      for (int k = 0; k < 3; ++k) level.texels[i][k] = render::clamped(value[k], 0, 65504);
    }
  });
  return level;
}

struct LobeSample {
  Vec3f direction;  // around +z
  float weight = 0;
};

/// Directions of light that a GGX lobe reflects to a viewer on the normal, by equal shares of half vectors;
/// each counts by its n.l (Karis 2013).
std::vector<LobeSample> lobe_samples(double roughness) {
  const double a2 = roughness * roughness * roughness * roughness;
  std::vector<LobeSample> out;
  double sum = 0;
  for (std::size_t i = 0; i < kLobeSamples; ++i) {
    double radical = 0, digit = 0.5;
    for (std::size_t n = i; n > 0; n /= 2, digit /= 2) radical += static_cast<double>(n % 2) * digit;
    const double share = (static_cast<double>(i) + 0.5) / kLobeSamples;
    const double cos_h = std::sqrt((1 - share) / (1 + (a2 - 1) * share));
    const double z = 2 * cos_h * cos_h - 1;  // the mirror of +z at the half vector
    if (z <= 0) continue;
    const double ring = std::sqrt(std::max(0.0, 1 - z * z)), angle = 2 * portable::kPi * radical;
    out.push_back({{static_cast<float>(ring * portable::cos(angle)),
                    static_cast<float>(ring * portable::sin(angle)), static_cast<float>(z)},
                   static_cast<float>(z)});
    sum += z;
  }
  for (LobeSample& s : out) s.weight = static_cast<float>(s.weight / sum);
  return out;
}

Vec3f filtered(const Level& radiance, const std::vector<LobeSample>& lobe, Vec3f z) {
  // Any pair of axes serves; this one has no seam near the poles.
  const Vec3f x = normalized(cross(z.y < 0.9f && z.y > -0.9f ? Vec3f{0, 1, 0} : Vec3f{1, 0, 0}, z));
  const Vec3f y = cross(z, x);
  Vec3f sum;
  for (const LobeSample& s : lobe)
    sum = sum + read_level(radiance, x * s.direction.x + y * s.direction.y + z * s.direction.z) * s.weight;
  return sum;
}

Harmonics harmonics_of(Vec3d d) {
  return {0.28209479177387814,
          0.48860251190291992 * d.y,
          0.48860251190291992 * d.z,
          0.48860251190291992 * d.x,
          1.0925484305920792 * d.x * d.y,
          1.0925484305920792 * d.y * d.z,
          0.31539156525252005 * (3 * d.z * d.z - 1),
          1.0925484305920792 * d.x * d.z,
          0.54627421529603959 * (d.x * d.x - d.y * d.y)};
}

std::array<Vec3f, 9> irradiance_of(const Radiance& radiance) {
  constexpr int kRings = 64, kPlaces = 128;
  std::array<Vec3d, 9> sum{};
  for (int i = 0; i < kRings; ++i) {
    // Rings of equal area
    const double up = 1 - 2 * (i + 0.5) / kRings, ring = std::sqrt(1 - up * up);
    for (int j = 0; j < kPlaces; ++j) {
      const double angle = 2 * portable::kPi * (j + 0.5) / kPlaces;
      const Vec3d d{ring * portable::cos(angle), up, ring * portable::sin(angle)};
      const Vec3f light = radiance(to_float(d));
      const Harmonics basis = harmonics_of(d);
      for (std::size_t k = 0; k < 9; ++k)
        for (int c = 0; c < 3; ++c)
          sum[k][c] += basis[k] * static_cast<double>(render::clamped(light[c], 0, 65504));
    }
  }
  // A cosine lobe over pi weighs the bands by 1, 2/3 and 1/4.
  std::array<Vec3f, 9> out;
  for (std::size_t k = 0; k < 9; ++k)
    out[k] = to_float(sum[k] * (4 * portable::kPi / (kRings * kPlaces) *
                                (k == 0  ? 1
                                 : k < 4 ? 2.0 / 3
                                         : 0.25)));
  return out;
}

}  // namespace

RenderEnvironment prepare_environment(const Radiance& radiance, const KeyLight& key,
                                      const RunContext& context) {
  RenderEnvironment out;
  out.key = key;
  out.irradiance = irradiance_of(radiance);
  out.levels.push_back(make_level(kSharpSide, context, radiance));
  for (std::size_t i = 1; i < kLevels; ++i) {
    const std::vector<LobeSample> lobe = lobe_samples(static_cast<double>(i) / (kLevels - 1));
    out.levels.push_back(make_level(i < 3 ? kBlurredSide : kBroadSide, context, [&](Vec3f direction) {
      return filtered(out.levels.front(), lobe, direction);
    }));
  }
  return out;
}

Vec3f diffuse_light(const RenderEnvironment& environment, Vec3f n) {
  const std::array<Vec3f, 9>& h = environment.irradiance;
  const float basis[9] = {0.282094792f,
                          0.488602512f * n.y,
                          0.488602512f * n.z,
                          0.488602512f * n.x,
                          1.092548431f * n.x * n.y,
                          1.092548431f * n.y * n.z,
                          0.315391565f * (3 * n.z * n.z - 1),
                          1.092548431f * n.x * n.z,
                          0.546274215f * (n.x * n.x - n.y * n.y)};
  Vec3f sum;
  for (std::size_t k = 0; k < 9; ++k) sum = sum + h[k] * basis[k];
  return {render::clamped(sum.x, 0, 65504), render::clamped(sum.y, 0, 65504),
          render::clamped(sum.z, 0, 65504)};
}

Vec3f specular_light(const RenderEnvironment& environment, Vec3f direction, float roughness) {
  const float at = render::saturated(roughness) * static_cast<float>(environment.levels.size() - 1);
  const auto sharp = std::min(static_cast<std::size_t>(at), environment.levels.size() - 2);
  const Vec3f a = read_level(environment.levels[sharp], direction),
              b = read_level(environment.levels[sharp + 1], direction);
  return a + (b - a) * (at - static_cast<float>(sharp));
}

}  // namespace texmesh
