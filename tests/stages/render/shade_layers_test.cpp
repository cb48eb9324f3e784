// Alpha: mask and blend.
#include <gtest/gtest.h>

#include <cmath>

#include "format/base/portable_math.h"
#include "stages/render/shade.h"
#include "tests/stages/render/render_fixtures.h"

namespace texmesh::shade_layers_test {

using testing::at;
using testing::even_light;
using testing::front_camera;
using testing::joined;
using testing::SmallScene;
using testing::square;
using testing::texture_of;
using testing::unlit;

constexpr double kCode = 1e-3;

RenderMaterial glass(Vec4f colour) {
  RenderMaterial m = unlit(colour);
  m.alpha_mode = AlphaMode::kBlend;
  return m;
}
double code(float light) { return srgb_of_light(static_cast<double>(light)); }
double shown(float base) { return code(tone_mapped({base, base, base}).x); }

// Squares one before the other; the first is the farthest.
SmallScene stack(const std::vector<RenderMaterial>& materials) {
  SmallScene scene{square(), materials, {}};
  for (std::uint16_t i = 1; i < materials.size(); ++i)
    scene.mesh = joined(scene.mesh, square(), i, {0, 0, 0.05f * static_cast<float>(i)});
  return scene;
}

TEST(ShadeLayers, BlendingMixesEncodedColours) {
  const SmallScene scene = stack({unlit({0.6f, 0.6f, 0.6f, 1}), glass({0.1f, 0.1f, 0.1f, 0.25f})});
  const Picture picture = scene.picture(front_camera(12), 9, even_light({}));
  EXPECT_NEAR(code(at(picture, 4, 3).x), 0.25 * shown(0.1f) + 0.75 * shown(0.6f), kCode);
}

TEST(ShadeLayers, LayersAreMixedFromFarToNearWhateverTheirOrder) {
  const double far_first = 0.5 * shown(0.1f) + 0.5 * (0.75 * shown(0.8f) + 0.25 * shown(0.4f));
  SmallScene scene = stack(
      {unlit({0.4f, 0.4f, 0.4f, 1}), glass({0.8f, 0.8f, 0.8f, 0.75f}), glass({0.1f, 0.1f, 0.1f, 0.5f})});
  EXPECT_NEAR(code(at(scene.picture(front_camera(12), 9, even_light({})), 4, 3).x), far_first, kCode);
  std::swap(scene.mesh.triangles[2], scene.mesh.triangles[4]);
  std::swap(scene.mesh.triangles[3], scene.mesh.triangles[5]);
  std::swap(scene.mesh.triangle_material[2], scene.mesh.triangle_material[4]);
  std::swap(scene.mesh.triangle_material[3], scene.mesh.triangle_material[5]);
  EXPECT_NEAR(code(at(scene.picture(front_camera(12), 9, even_light({})), 4, 3).x), far_first, kCode);
}

TEST(ShadeLayers, GlassBeforeNothingLetsTheBackgroundThrough) {
  RenderEnvironment light = even_light({});
  light.background = {0.3f, 0.3f, 0.3f};
  const Picture picture = stack({glass({0.9f, 0.9f, 0.9f, 0.5f})}).picture(front_camera(), 9, light);
  EXPECT_NEAR(code(at(picture, 4, 3).x), 0.5 * shown(0.9f) + 0.5 * code(0.3f), kCode);
  EXPECT_EQ(picture.covered[4], 1);
}

TEST(ShadeLayers, WhatIsWhollyTransparentIsNotThere) {
  const RenderEnvironment light = even_light({});
  const Picture picture = stack({glass({0.9f, 0.9f, 0.9f, 0})}).picture(front_camera(), 9, light);
  for (std::size_t i = 0; i < picture.linear.size(); ++i) {
    EXPECT_NEAR(picture.linear[i].x, light.background.x, 1e-6);
    EXPECT_EQ(picture.covered[i], 0);
  }
}

TEST(ShadeLayers, AMaskShowsWhereItsAlphaReachesTheCutoff) {
  SmallScene scene = stack({unlit({0.2f, 0.2f, 0.2f, 1}), unlit({0.8f, 0.8f, 0.8f, 1})});
  scene.materials[1].alpha_mode = AlphaMode::kMask;
  scene.materials[1].slot(TextureUse::kBaseColour).texture = 0;
  scene.materials[1].slot(TextureUse::kBaseColour).mag_filter = MagFilter::kNearest;
  scene.textures = {texture_of(2, 1, 4, true, [](auto x, auto, auto c) {
    return static_cast<std::uint8_t>(c < 3 ? 255 : x == 0 ? 127 : 128);
  })};
  const Picture picture = scene.picture(front_camera(10.05), 16, even_light({}));
  EXPECT_NEAR(code(at(picture, 2, 8).x), shown(0.2f), kCode);
  EXPECT_NEAR(code(at(picture, 13, 8).x), shown(0.8f), kCode);
  scene.materials[1].alpha_cutoff = 0.6f;
  EXPECT_NEAR(code(at(scene.picture(front_camera(10.05), 16, even_light({})), 13, 8).x), shown(0.2f), kCode);
}

TEST(ShadeLayers, AMaskHidesWhatStandsBehindIt) {
  SmallScene scene =
      stack({glass({0.9f, 0, 0, 0.5f}), unlit({0.3f, 0.3f, 0.3f, 1}), glass({0.6f, 0.6f, 0.6f, 0.5f})});
  scene.materials[1].alpha_mode = AlphaMode::kMask;
  const Picture picture = scene.picture(front_camera(12), 9, even_light({}));
  EXPECT_NEAR(code(at(picture, 4, 3).x), 0.5 * shown(0.6f) + 0.5 * shown(0.3f), kCode);
  EXPECT_NEAR(at(picture, 4, 3).x, at(picture, 4, 3).y, 1e-5);
}

TEST(ShadeLayers, OneVisibilityServesTexturesOfAnyAlpha) {
  SmallScene scene = stack({unlit({0.2f, 0.2f, 0.2f, 1}), unlit({0.8f, 0.8f, 0.8f, 1})});
  scene.materials[1].alpha_mode = AlphaMode::kMask;
  scene.materials[1].slot(TextureUse::kBaseColour).texture = 0;
  auto even = [](std::uint8_t alpha) {
    return texture_of(1, 1, 4, true,
                      [alpha](auto, auto, auto c) { return c < 3 ? std::uint8_t{255} : alpha; });
  };
  scene.textures.resize(1);
  const Visibility seen = scene.seen(front_camera(12), 9);
  const RenderEnvironment light = even_light({});
  EXPECT_NEAR(code(at(shade(scene.scene(), seen, {even(255)}, light, {}), 4, 3).x), shown(0.8f), kCode);
  EXPECT_NEAR(code(at(shade(scene.scene(), seen, {even(0)}, light, {}), 4, 3).x), shown(0.2f), kCode);
}

}  // namespace texmesh::shade_layers_test
