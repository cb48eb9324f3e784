// Several lists of materials on one view.
#include <gtest/gtest.h>

#include <algorithm>
#include <stdexcept>

#include "stages/render/shade.h"
#include "tests/stages/render/render_fixtures.h"

namespace texmesh::shade_variants_test {

using testing::front_camera;
using testing::plain;
using testing::SmallScene;
using testing::square;
using testing::texture_of;

RenderTexture pattern(std::uint32_t side, std::uint32_t channels, bool srgb, std::uint32_t seed) {
  return texture_of(side, side, channels, srgb, [seed](auto x, auto y, auto c) {
    return static_cast<std::uint8_t>(c == 2 ? 200 : 60 + (x * 37 + y * 59 + c * 101 + seed * 13) % 120);
  });
}

/// Textures 0 to 4 stand in the slots by use; the others replace them.
SmallScene textured_scene() {
  SmallScene scene{testing::sphere(16, 32), {plain({0.9f, 0.8f, 0.7f, 1}, 0.6f, 0.7f)}, {}};
  scene.mesh.triangle_material.assign(scene.mesh.triangles.size(), 0);
  scene.materials[0].emissive = {0.2f, 0.1f, 0.3f};
  for (std::uint32_t use = 0; use < kTextureUses; ++use) {
    scene.materials[0].textures[use].texture = static_cast<std::int32_t>(use);
    scene.textures.push_back(pattern(16, 3, is_srgb(static_cast<TextureUse>(use)), use));
  }
  for (std::uint32_t use = 0; use < kTextureUses; ++use)
    scene.textures.push_back(pattern(use == 1 ? 4 : 16, 3, is_srgb(static_cast<TextureUse>(use)), 40 + use));
  // The source's own coarser levels.
  RenderTexture coarse = scene.textures[0];
  coarse.levels.erase(coarse.levels.begin(), coarse.levels.begin() + 2);
  coarse.first_level = 2;
  scene.textures.push_back(coarse);
  return scene;
}

using Materials = std::vector<RenderMaterial>;

/// One slot replaced at a time, all of them, a texture that is not there, and two slots with one texture.
std::vector<Materials> variants_of(const SmallScene& scene) {
  std::vector<Materials> out(1, scene.materials);
  Materials all = scene.materials;
  for (std::size_t use = 0; use < kTextureUses; ++use) {
    out.push_back(scene.materials);
    out.back()[0].textures[use].texture += kTextureUses;
    all[0].textures[use].texture += kTextureUses;
  }
  out.push_back(all);
  out.push_back(scene.materials);
  out.back()[0].slot(TextureUse::kNormal).texture = -1;
  out.push_back(scene.materials);
  out.back()[0].slot(TextureUse::kOcclusion).texture =
      out.back()[0].slot(TextureUse::kMetallicRoughness).texture;
  out.push_back(scene.materials);
  out.back()[0].slot(TextureUse::kBaseColour).texture = 2 * static_cast<std::int32_t>(kTextureUses);
  return out;
}

void expect_as_alone(const SmallScene& scene, const std::vector<Materials>& variants,
                     const RunContext& context) {
  const RenderEnvironment studio = studio_environment();
  const RenderScene shown = render_scene(scene.mesh, scene.materials, scene.textures.size());
  const Visibility seen = look(shown, perspective_camera(camera_of(1, 4, {}, 1.5)), 48, {});
  std::vector<const Materials*> lists;
  for (const Materials& m : variants) lists.push_back(&m);
  const PictureVariants pictures = shade_variants(shown, seen, lists, scene.textures, studio, context);
  ASSERT_EQ(pictures.count(), variants.size());
  const FlipPicture first = prepare_flip(pictures.picture(0));
  for (std::size_t v = 0; v < variants.size(); ++v) {
    const RenderScene alone = render_scene(scene.mesh, variants[v], scene.textures.size());
    const Picture expected = shade(alone, seen, scene.textures, studio, {});
    const Picture picture = pictures.picture(v);
    EXPECT_EQ(picture.side_px, expected.side_px);
    EXPECT_EQ(picture.linear, expected.linear) << v;
    EXPECT_EQ(picture.covered, expected.covered) << v;
    const FlipSum in_spans = compare_flip(first, picture, pictures.spans()),
                  whole = compare_flip(first, picture);
    EXPECT_EQ(in_spans.sum, whole.sum) << v;
    EXPECT_EQ(in_spans.pixels, whole.pixels) << v;
  }
}

TEST(ShadeVariants, EachIsThePictureThatItsMaterialsGiveAlone) {
  const SmallScene scene = textured_scene();
  std::vector<Materials> variants = variants_of(scene);
  expect_as_alone(scene, variants, {});
  std::reverse(variants.begin(), variants.end());
  expect_as_alone(scene, variants, {8, {}, nullptr});
}

TEST(ShadeVariants, AlphaMayHideAFragmentInOneOfThem) {
  for (const AlphaMode mode : {AlphaMode::kMask, AlphaMode::kBlend}) {
    SmallScene scene = textured_scene();
    scene.materials[0].alpha_mode = mode;
    scene.textures[0] = pattern(16, 4, true, 3);
    scene.textures[kTextureUses] = pattern(16, 4, true, 900);
    scene.textures[kTextureUses + 1] =
        texture_of(4, 4, 4, true, [](auto, auto, auto) { return std::uint8_t{0}; });
    scene.materials[0].double_sided = true;
    std::vector<Materials> variants = variants_of(scene);
    variants.push_back(scene.materials);
    variants.back()[0].slot(TextureUse::kBaseColour).texture = static_cast<std::int32_t>(kTextureUses) + 1;
    expect_as_alone(scene, variants, {});
    std::reverse(variants.begin(), variants.end());
    expect_as_alone(scene, variants, {});
  }
}

TEST(ShadeVariants, TheFirstOneMayShowNothingInPartsOfThePicture) {
  SmallScene scene = textured_scene();
  scene.materials[0].alpha_mode = AlphaMode::kMask;
  scene.materials[0].slot(TextureUse::kNormal).texture = -1;
  scene.textures[0] = texture_of(16, 16, 4, true, [](auto x, auto, auto c) {
    return std::uint8_t(c < 3 ? 130 : x < 8 ? 0 : 255);
  });
  expect_as_alone(scene, {scene.materials, variants_of(scene)[1]}, {});
}

TEST(ShadeVariants, OtherLengthsAreRefused) {
  const SmallScene scene{square(), {plain({1, 1, 1, 1})}, {}};
  const RenderScene shown = render_scene(scene.mesh, scene.materials, 0);
  const Visibility seen = look(shown, front_camera(), 4, {});
  const Materials two(2, scene.materials[0]);
  const std::vector<const Materials*> lists{&scene.materials, &two};
  EXPECT_THROW(shade_variants(shown, seen, lists, {}, studio_environment(), {}), std::invalid_argument);
  EXPECT_EQ(shade_variants(shown, seen, {}, {}, studio_environment(), {}).count(), 0u);
}

}  // namespace texmesh::shade_variants_test
