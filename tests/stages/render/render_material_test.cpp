#include "stages/render/visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace texmesh::render_material_test {

std::int32_t no_texture(const TextureRef&, TextureUse) { return -1; }

TEST(RenderMaterial, TakesOverWhatGltfSays) {
  Material from;
  from.base_colour = {0.1f, 0.2f, 0.3f, 0.4f};
  from.metallic = 0.5f, from.roughness = 0.6f, from.emissive = {0.7f, 0.8f, 0.9f};
  from.normal_scale = -2, from.occlusion_strength = 0.25f;
  from.alpha_mode = AlphaMode::kMask, from.alpha_cutoff = 0.3f;
  from.double_sided = from.unlit = true;
  const RenderMaterial m = render_material(from, no_texture);
  EXPECT_EQ(m.base_colour, from.base_colour);
  EXPECT_EQ(m.metallic, 0.5f);
  EXPECT_EQ(m.roughness, 0.6f);
  EXPECT_EQ(m.emissive, from.emissive);
  EXPECT_EQ(m.normal_scale, -2);
  EXPECT_EQ(m.occlusion_strength, 0.25f);
  EXPECT_EQ(m.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(m.alpha_cutoff, 0.3f);
  EXPECT_TRUE(m.double_sided);
  EXPECT_TRUE(m.unlit);
  for (const TextureSlot& slot : m.textures) EXPECT_EQ(slot.texture, -1);
}

TEST(RenderMaterial, EveryUseHasItsSlotAndAnImageMayServeTwice) {
  Material from;
  from.base_colour_texture.image = from.emissive_texture.image = 3;
  from.metallic_roughness_texture.image = from.occlusion_texture.image = 3;
  from.normal_texture = {
      4, 1, Wrap::kClamp, Wrap::kMirror, true, Minification::kLinearMipmapLinear, {{0.1f, 0.2f}, {2, 2}, 1}};
  const RenderMaterial m = render_material(
      from, [](const TextureRef& ref, TextureUse use) { return ref.image * 2 + (is_srgb(use) ? 1 : 0); });
  EXPECT_EQ(m.slot(TextureUse::kBaseColour).texture, 7);
  EXPECT_EQ(m.slot(TextureUse::kEmissive).texture, 7);
  EXPECT_EQ(m.slot(TextureUse::kMetallicRoughness).texture, 6);
  EXPECT_EQ(m.slot(TextureUse::kOcclusion).texture, 6);
  const TextureSlot& normal = m.slot(TextureUse::kNormal);
  EXPECT_EQ(normal.texture, 8);
  EXPECT_EQ(normal.uv_set, 1);
  EXPECT_EQ(normal.wrap_s, Wrap::kClamp);
  EXPECT_EQ(normal.wrap_t, Wrap::kMirror);
  EXPECT_EQ(normal.mag_filter, MagFilter::kNearest);
  EXPECT_EQ(normal.min_filter, MinFilter::kTrilinear);
  EXPECT_EQ(normal.transform, from.normal_texture.transform);
}

TEST(RenderMaterial, FiltersWithMipLevelsAreOneAndTheOthersAreKept) {
  for (const auto& [from, to] : {std::pair{Minification::kNearest, MinFilter::kNearest},
                                 {Minification::kLinear, MinFilter::kLinear},
                                 {Minification::kNearestMipmapNearest, MinFilter::kTrilinear},
                                 {Minification::kLinearMipmapNearest, MinFilter::kTrilinear},
                                 {Minification::kNearestMipmapLinear, MinFilter::kTrilinear},
                                 {Minification::kLinearMipmapLinear, MinFilter::kTrilinear}}) {
    Material material;
    material.emissive_texture.image = 0;
    material.emissive_texture.minification = from;
    const RenderMaterial m = render_material(material, no_texture);
    EXPECT_EQ(m.slot(TextureUse::kEmissive).min_filter, to);
    EXPECT_EQ(m.slot(TextureUse::kEmissive).mag_filter, MagFilter::kLinear);
  }
}

TEST(RenderMaterial, OfTheExtensionsTheStrengthOfEmissionCounts) {
  Material from;
  from.emissive = {1, 0.5f, 0};
  from.extensions = {{"KHR_materials_emissive_strength", {{"emissiveStrength", {4}}}, {}},
                     {"KHR_materials_transmission", {{"transmissionFactor", {1}}}, {}}};
  EXPECT_EQ(render_material(from, no_texture).emissive, (Vec3f{4, 2, 0}));
}

TEST(RenderMaterial, HostileNumbersBecomeThoseOfTheSpecification) {
  Material from;
  const float nan = std::nanf(""), infinity = std::numeric_limits<float>::infinity();
  from.base_colour = {nan, -1, 7, infinity};
  from.metallic = nan, from.roughness = -3, from.emissive = {nan, infinity, -1};
  from.normal_scale = infinity, from.occlusion_strength = 9, from.alpha_cutoff = nan;
  from.base_colour_texture.image = 0;
  from.base_colour_texture.transform.scale.x = nan;
  const RenderMaterial m = render_material(from, [](const TextureRef&, TextureUse) { return 0; });
  EXPECT_EQ(m.base_colour, (Vec4f{1, 0, 1, 1}));
  EXPECT_EQ(m.metallic, 1);
  EXPECT_EQ(m.roughness, 0);
  EXPECT_EQ(m.emissive, (Vec3f{0, 0, 0}));
  EXPECT_EQ(m.normal_scale, 1);
  EXPECT_EQ(m.occlusion_strength, 1);
  EXPECT_EQ(m.alpha_cutoff, 0.5f);
  EXPECT_TRUE(m.slot(TextureUse::kBaseColour).transform.is_identity());
}

}  // namespace texmesh::render_material_test
