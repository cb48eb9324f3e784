#include "stages/render/lighting.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/stages/render/render_fixtures.h"

namespace texmesh::brdf_test {

constexpr double kTurn = 3.14159265358979323846;

Vec3f radiance_towards(const LitSurface& surface, Vec3f to_viewer, const RenderEnvironment& environment) {
  return radiance_of(surface, lighting_of(surface, to_viewer, environment), environment);
}

Vec3f direction(double polar, double turn) {
  return to_float(Vec3d{std::sin(polar) * std::cos(turn), std::sin(polar) * std::sin(turn), std::cos(polar)});
}
// The integral over the hemisphere of +Z.
template <class F>
double over_hemisphere(int steps, F f) {
  double sum = 0;
  for (int i = 0; i < steps; ++i)
    for (int j = 0; j < steps; ++j) {
      const double polar = (i + 0.5) / steps * kTurn / 2, turn = (j + 0.5) / steps * 2 * kTurn;
      sum += f(direction(polar, turn), std::cos(polar)) * std::sin(polar);
    }
  return sum * (kTurn / 2 / steps) * (2 * kTurn / steps);
}

TEST(Brdf, DistributionOfHalfVectorsIntegratesToOne) {
  for (const double roughness : {0.2, 0.4, 0.7, 1.0})
    EXPECT_NEAR(over_hemisphere(600,
                                [&](Vec3f, double cosine) {
                                  return ggx_distribution(static_cast<float>(roughness * roughness),
                                                          static_cast<float>(cosine)) *
                                         cosine;
                                }),
                1, 2e-3)
        << roughness;
}

TEST(Brdf, MaskingIsThatOfSmithAndSchlickThatOfTheSpecification) {
  for (const double alpha : {0.04, 0.3, 1.0})
    for (const double l : {0.1, 0.5, 1.0})
      for (const double v : {0.2, 0.9}) {
        auto lambda = [&](double c) { return (std::sqrt(1 + alpha * alpha * (1 / (c * c) - 1)) - 1) / 2; };
        const double expected = 1 / (1 + lambda(l) + lambda(v)) / (4 * l * v);
        EXPECT_NEAR(
            smith_visibility(static_cast<float>(alpha), static_cast<float>(l), static_cast<float>(v)) /
                expected,
            1, 1e-5);
      }
  EXPECT_NEAR(schlick_weight(0.3f), std::pow(0.7, 5), 1e-7);
}

TEST(Brdf, NoSurfaceReflectsMoreThanItGets) {
  // Of glTF's dielectrics this is so for views that do not graze: their two lobes share light by v.h alone.
  for (const float metallic : {0.f, 1.f})
    for (const float roughness : {0.15f, 0.4f, 1.f})
      for (const double angle : {0.1, 0.8, 1.4}) {
        if (metallic == 0 && angle > 1) continue;
        LitSurface s;
        s.metallic = metallic, s.roughness = roughness;
        const double sum = over_hemisphere(
            500, [&](Vec3f l, double) { return reflected_by_brdf(s, l, direction(angle, 0)).x; });
        EXPECT_LE(sum, 1.005) << metallic << " " << roughness << " " << angle;
        EXPECT_GT(sum, 0.3);
      }
}

TEST(Brdf, LightAndViewerMayChangePlaces) {
  LitSurface s;
  s.metallic = 0.3f, s.roughness = 0.4f, s.base_colour = {0.8f, 0.5f, 0.2f};
  const Vec3f l = direction(0.4, 1), v = direction(1.1, 2.5);
  const Vec3f there = reflected_by_brdf(s, l, v) * (1 / l.z), back = reflected_by_brdf(s, v, l) * (1 / v.z);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(there[k], back[k], 1e-5);
}

TEST(Brdf, TheDiffusePartIsLambertsWithoutWhatFresnelReflects) {
  LitSurface white, black;
  black.base_colour = {};
  const Vec3f l = direction(0.9, 0.4), v = direction(0.5, 2);
  const double difference = static_cast<double>(reflected_by_brdf(white, l, v).x) -
                            static_cast<double>(reflected_by_brdf(black, l, v).x);
  const double vh = dot(to_double(v), normalized(to_double(l) + to_double(v)));
  const double fresnel = 0.04 + 0.96 * std::pow(1 - vh, 5);
  EXPECT_NEAR(difference, (1 - fresnel) / kTurn * std::cos(0.9), 1e-6);
}

TEST(Brdf, AWhiteFurnaceReturnsItsLightForAllRoughness) {
  const RenderEnvironment even = testing::even_light({0.7f, 0.5f, 0.3f});
  for (const float metallic : {0.f, 1.f})
    for (const float roughness : {kLeastRoughness, 0.3f, 1.f})
      for (const double angle : {0., 0.9, 1.5}) {
        LitSurface s;
        s.metallic = metallic, s.roughness = roughness;
        const Vec3f out = radiance_towards(s, direction(angle, 0.3), even);
        EXPECT_NEAR(out.x, 0.7, 0.002);
        EXPECT_NEAR(out.y, 0.5, 0.002);
        EXPECT_NEAR(out.z, 0.3, 0.002);
      }
}

TEST(Brdf, SplitSumIsNearTheIntegral) {
  for (const double roughness : {0.3, 0.6, 0.9})
    for (const double angle : {0.3, 0.8, 1.2}) {
      LitSurface s;
      s.metallic = 1, s.roughness = static_cast<float>(roughness);  // F0 = 1: scale + bias
      const double sum = over_hemisphere(
          400, [&](Vec3f l, double) { return reflected_by_brdf(s, l, direction(angle, 0)).x; });
      const Vec2f ab = split_sum(static_cast<float>(roughness), static_cast<float>(std::cos(angle)));
      // The fit is a coarse one; three.js has it. What it loses comes back as multiple scattering.
      EXPECT_NEAR(ab.x + ab.y, sum, 0.16) << roughness << " " << angle;
      EXPECT_GE(ab.y, -0.002f);
      EXPECT_LE(ab.x + ab.y, 1);
    }
}

TEST(Brdf, OcclusionDarkensTheEnvironmentAndNotTheKeyLight) {
  LitSurface open, shut;
  shut.occlusion = 0;
  const Vec3f v = direction(0.3, 1);
  const RenderEnvironment even = testing::even_light({1, 1, 1});
  EXPECT_NEAR(radiance_towards(shut, v, even).x, 0, 1e-4);
  LitSurface half;
  half.occlusion = 0.5f;
  EXPECT_NEAR(radiance_towards(half, v, even).x, 0.5, 0.02);
  const RenderEnvironment key = testing::only_key_light({0, 0, 1}, {1, 1, 1});
  EXPECT_EQ(radiance_towards(shut, v, key), radiance_towards(open, v, key));
}

TEST(Brdf, EmissionIsAdded) {
  LitSurface s;
  s.emission = {0.1f, 0.2f, 0.3f};
  const Vec3f out = radiance_towards(s, {0, 0, 1}, testing::even_light({}));
  EXPECT_EQ(out, s.emission);
}

void set_lane(SurfaceOf<Lanes>& to, std::size_t lane, const LitSurface& s) {
  for (const auto& [vec, from] : {std::pair{&to.normal, s.normal}, std::pair{&to.base_colour, s.base_colour},
                                  std::pair{&to.emission, s.emission}})
    vec->x[lane] = from.x, vec->y[lane] = from.y, vec->z[lane] = from.z;
  to.metallic[lane] = s.metallic, to.roughness[lane] = s.roughness, to.occlusion[lane] = s.occlusion;
}

TEST(Brdf, EachLaneHasTheBitsOfASurfaceAlone) {
  testing::Random random{1};
  // Among others both ends of the range, which have rules of their own.
  const auto part = [&] { return std::clamp(static_cast<float>(1.2 * random.uniform() - 0.1), 0.f, 1.f); };
  const auto any_direction = [&] {
    return direction(4 * static_cast<double>(part()), 7 * static_cast<double>(part()));
  };
  const RenderEnvironment lights[] = {studio_environment(), testing::only_key_light({0, 0, 1}, {9, 1, 0.1f}),
                                      daylight_environment({1, 0, 0}, {0, 1, 0}, {0, 0, 1}, true)};
  for (int round = 0; round < 500; ++round) {
    const RenderEnvironment& light = lights[round % 3];
    LitSurface alone[kLanes];
    Vec3f viewer[kLanes];
    SurfaceOf<Lanes> together;
    Vec3<Lanes> viewers;
    for (std::size_t i = 0; i < kLanes; ++i) {
      alone[i] = {round % 7 == 0 && i == 0 ? Vec3f{} : any_direction(),
                  {part(), part(), part()},
                  {part(), 0, 0},
                  part(),
                  std::max(part(), kLeastRoughness),
                  part()};
      viewer[i] = any_direction();
      set_lane(together, i, alone[i]);
      viewers.x[i] = viewer[i].x, viewers.y[i] = viewer[i].y, viewers.z[i] = viewer[i].z;
    }
    const auto lighting = lighting_of(together, viewers, light);
    const Vec3<Lanes> seen = tone_mapped_of(radiance_of(together, lighting, light));
    for (std::size_t i = 0; i < kLanes; ++i)
      EXPECT_EQ((Vec3f{seen.x[i], seen.y[i], seen.z[i]}),
                tone_mapped_of(radiance_towards(alone[i], viewer[i], light)))
          << round << ' ' << i;
  }
}

TEST(Brdf, LightFromBehindDoesNotCount) {
  LitSurface s;
  EXPECT_EQ(reflected_by_brdf(s, {0, 0, -1}, {0, 0, 1}), (Vec3f{}));
  // A normal turned away from the viewer still gives numbers.
  const Vec3f out = radiance_towards(s, {0, 0, -1}, testing::even_light({1, 1, 1}));
  EXPECT_TRUE(is_finite(out));
  EXPECT_GE(out.x, 0);
}

}  // namespace texmesh::brdf_test
