#include "stages/render/environment.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/render/render_math.h"
#include "tests/stages/render/render_fixtures.h"

namespace texmesh::environment_test {

// Directions spread over the sphere.
std::vector<Vec3f> directions(int count) {
  std::vector<Vec3f> out;
  for (int i = 0; i < count; ++i) {
    const double up = 1 - 2 * (i + 0.5) / count, ring = std::sqrt(1 - up * up), turn = 2.399963 * i;
    out.push_back(to_float(Vec3d{ring * std::cos(turn), up, ring * std::sin(turn)}));
  }
  return out;
}
// The mean under a Gaussian of the angle, by brute force.
Vec3d blurred_by_sum(const Radiance& radiance, Vec3f middle, double variance) {
  Vec3d sum;
  double weights = 0;
  for (const Vec3f d : directions(60000)) {
    const double angle = std::acos(std::clamp(static_cast<double>(dot(d, middle)), -1.0, 1.0));
    const double weight = std::exp(-angle * angle / (2 * variance));
    sum = sum + to_double(radiance(d)) * weight;
    weights += weight;
  }
  return sum * (1 / weights);
}

// What processors do for all channels at once, channel by channel.
float diffuse_channel(const RenderEnvironment& light, Vec3f normal, float Vec4f::*channel) {
  float sum = 0;
  for (std::size_t k = 0; k < RenderEnvironment::kHarmonics; ++k) {
    RenderEnvironment one;  // whose light is the harmonic itself, and without its sign
    one.irradiance.fill({});
    one.irradiance[k] = {1, -1, 0, 0};
    const Vec3f basis = diffuse_light(one, normal);
    sum += light.irradiance[k].*channel * (basis.x - basis.y);
  }
  return clamped(sum, 0, 65504);
}

float level_channel(const RenderEnvironment::Level& level, Vec2f place, float Vec4f::*channel) {
  const float scale = static_cast<float>(level.side - 2) * 0.5f, end = static_cast<float>(level.side - 1);
  const float x = clamped((place.x + 1) * scale + 0.5f, 0, end),
              y = clamped((place.y + 1) * scale + 0.5f, 0, end);
  const auto column = std::min(static_cast<std::size_t>(x), std::size_t{level.side - 2}),
             row = std::min(static_cast<std::size_t>(y), std::size_t{level.side - 2});
  const auto texel = [&](std::size_t dx, std::size_t dy) {
    return level.texels[(row + dy) * level.side + column + dx].*channel;
  };
  const float fx = x - static_cast<float>(column), fy = y - static_cast<float>(row);
  const float top = texel(0, 0) + (texel(1, 0) - texel(0, 0)) * fx,
              bottom = texel(0, 1) + (texel(1, 1) - texel(0, 1)) * fx;
  return top + (bottom - top) * fy;
}

float specular_channel(const RenderEnvironment& light, Vec3f direction, float roughness,
                       float Vec4f::*channel) {
  const float at = saturated(roughness) * static_cast<float>(light.levels.size() - 1);
  const auto sharp = std::min(static_cast<std::size_t>(at), light.levels.size() - 2);
  const Vec2f place = octahedral(direction);
  const float a = level_channel(light.levels[sharp], place, channel),
              b = level_channel(light.levels[sharp + 1], place, channel);
  return a + (b - a) * (at - static_cast<float>(sharp));
}

TEST(Environment, ChannelsSummedAtOnceHaveTheBitsOfEachByItself) {
  const RenderEnvironment lights[] = {studio_environment(),
                                      prepare_environment(
                                          [](Vec3f d) {
                                            return Vec3f{d.x > 0 ? 1e30f : 0, d.y * 65504, 1e-30f};
                                          },
                                          {}, {})};
  constexpr float Vec4f::*kChannels[] = {&Vec4f::x, &Vec4f::y, &Vec4f::z};
  for (const RenderEnvironment& light : lights)
    for (const Vec3f d : directions(300))
      for (int c = 0; c < 3; ++c) {
        EXPECT_EQ(diffuse_light(light, d)[c], diffuse_channel(light, d, kChannels[c])) << c;
        for (const float roughness : {0.f, 0.07f, 0.5f, 0.99f, 1.f})
          EXPECT_EQ(specular_light(light, d, roughness)[c],
                    specular_channel(light, d, roughness, kChannels[c]))
              << c << ' ' << roughness;
      }
}

TEST(Environment, PlacesOfTheOctahedronAreTheirDirections) {
  for (const Vec3f d : directions(1000)) {
    const Vec2f place = octahedral(d);
    EXPECT_LE(std::fabs(place.x), 1.0001f);
    EXPECT_LE(std::fabs(place.y), 1.0001f);
    EXPECT_NEAR(length(octahedral_direction(place) - d), 0, 1e-5);
  }
  // A place a little beyond a border is near the one inside of it.
  for (const float t : {-0.8f, -0.1f, 0.3f, 0.9f})
    for (const float side : {-1.f, 1.f}) {
      const Vec3f in = octahedral_direction({side * 0.99f, t}), out = octahedral_direction({side * 1.01f, t});
      EXPECT_GT(dot(in, out), 0.998f);
      EXPECT_GT(dot(octahedral_direction({t, side * 0.99f}), octahedral_direction({t, side * 1.01f})),
                0.998f);
    }
}

TEST(Environment, EvenLightIsEvenEverywhere) {
  const RenderEnvironment even = testing::even_light({0.2f, 0.7f, 3});
  for (const Vec3f d : directions(50)) {
    EXPECT_NEAR(diffuse_light(even, d).y, 0.7, 1e-3);
    for (const float roughness : {0.f, 0.1f, 0.5f, 0.99f, 1.f}) {
      EXPECT_NEAR(specular_light(even, d, roughness).x, 0.2, 1e-5);
      EXPECT_NEAR(specular_light(even, d, roughness).z, 3, 1e-4);
    }
  }
}

TEST(Environment, DiffuseLightIsTheStudioUnderTheBroadestBlur) {
  const RenderEnvironment studio = studio_environment();
  for (const Vec3f n : directions(24)) {
    const Vec3d expected = blurred_by_sum(studio_radiance, n, 0.32);
    const Vec3f found = diffuse_light(studio, n);
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(found[k] / expected[k], 1, 0.02);
  }
}

TEST(Environment, TheRoughestLevelIsDiffuseAndTheSharpestTheRadianceItself) {
  const RenderEnvironment studio = studio_environment();
  for (const Vec3f d : directions(100)) {
    EXPECT_NEAR(specular_light(studio, d, 1).y / diffuse_light(studio, d).y, 1, 0.04);
    EXPECT_NEAR(specular_light(studio, d, 0).y / studio_radiance(d).y, 1, 0.02);
  }
}

TEST(Environment, ALobeIsAGaussianWhoseWidthFollowsTheRoughness) {
  // A bright half space above: the share that a lobe across the border sees, by brute force.
  const Radiance radiance = [](Vec3f d) { return d.y > 0 ? Vec3f{1, 1, 1} : Vec3f{}; };
  const RenderEnvironment light = prepare_environment(radiance, {}, {});
  const Vec3f n = normalized(Vec3f{1, 0.3f, 0.2f});
  for (const auto& [level, variance] : {std::pair{3, 0.058}, {5, 0.21}, {7, 0.32}})
    EXPECT_NEAR(specular_light(light, n, static_cast<float>(level) / 7).x,
                blurred_by_sum(radiance, n, variance).x, 0.03)
        << level;
}

TEST(Environment, TheStudioIsNeutralAndLightsAWhiteBodyWithoutBurningIt) {
  const RenderEnvironment studio = studio_environment();
  const Vec4f flat = studio.irradiance[0];
  const Vec3f mean = Vec3f{flat.x, flat.y, flat.z} * 0.2820948f;
  EXPECT_NEAR(mean.x / mean.y, 1, 0.03);
  EXPECT_NEAR(mean.z / mean.y, 1, 0.03);
  float most = 0;
  for (const Vec3f d : directions(20000)) {
    for (int k = 0; k < 3; ++k) EXPECT_GT(studio_radiance(d)[k], 0);
    most = std::max(most, studio_radiance(d).y);
  }
  EXPECT_GT(most, 4);
  EXPECT_LT(most, 6.5);
  for (const Vec3f n : directions(50)) {
    const float facing = std::max(dot(n, studio.key.towards), 0.f) / 3.14159265f;
    const float plaster = 0.85f * (diffuse_light(studio, n).y + facing * studio.key.irradiance.y);
    EXPECT_GT(plaster, 0.12f);
    EXPECT_LT(plaster, 1.0f);
  }
}

// Values of three.js: a hemisphere light of intensity 3 from #ffffff above and #d8d4cc below.
TEST(Environment, DaylightIsTheLightOfViewers) {
  const Vec3f x{1, 0, 0}, y{0, 1, 0}, z{0, 0, 1};
  const auto srgb = [](double code) { return std::pow((code / 255 + 0.055) / 1.055, 2.4); };
  for (const bool metallic : {false, true}) {
    const RenderEnvironment light = daylight_environment(x, y, z, metallic);
    for (const Vec3f n : directions(50))
      for (int c = 0; c < 3; ++c) {
        const double below = srgb(std::array{0xd8, 0xd4, 0xcc}[static_cast<std::size_t>(c)]);
        const double up = 0.5 + 0.5 * static_cast<double>(n.y);
        EXPECT_NEAR(diffuse_light(light, n)[c], 3 / 3.14159265 * (below + (1 - below) * up), 4e-3);
        // Rough metals see what plaster sees, mirrors more contrast.
        const auto mirrored = static_cast<double>(specular_light(light, n, 1)[c]);
        EXPECT_NEAR(mirrored, metallic ? diffuse_light(light, n)[c] : 0, 8e-3) << "read between texels";
      }
    EXPECT_EQ(specular_light(light, y, 0).x > specular_light(light, y, 1).x, metallic);
    EXPECT_NEAR(dot(light.key.towards, normalized(Vec3f{-0.5f, 0.7f, 1})), 1, 1e-6);
  }
  // The camera carries the lamp.
  EXPECT_NEAR(dot(daylight_environment(z, y, x * -1, false).key.towards, normalized(Vec3f{-1, 0.7f, -0.5f})),
              1, 1e-6);
}

TEST(Environment, HostileRadianceIsCutOff) {
  const RenderEnvironment light = prepare_environment(
      [](Vec3f d) {
        return Vec3f{std::nanf(""), d.x > 0 ? -1.f : 1e30f, std::numeric_limits<float>::infinity()};
      },
      {}, {});
  for (const Vec3f d : directions(50)) {
    EXPECT_TRUE(is_finite(diffuse_light(light, d)));
    for (const float roughness : {0.f, 0.3f, 1.f, std::nanf("")}) {
      const Vec3f s = specular_light(light, d, roughness);
      EXPECT_TRUE(is_finite(s));
      EXPECT_GE(s.y, 0);
    }
  }
  EXPECT_TRUE(is_finite(specular_light(light, {}, 0.5f)));
}

}  // namespace texmesh::environment_test
