#include "stages/proxies/make_proxy.h"

#include <gtest/gtest.h>

#include "stages/proxies/coding/proxy_glb.h"
#include "tests/support/meshes.h"

namespace texmesh::picture_losses_test {

ShownModel plain_model(const Mesh& mesh, Vec4f colour) {
  ShownModel out{mesh, {}};
  RenderMaterial material;
  material.base_colour = colour;
  material.metallic = 0;
  out.shown.materials = {material};
  return out;
}

TEST(PictureLoss, S0ItselfHasNoLossAndAnotherColourHasOne) {
  const ShownModel source = plain_model(testing::sphere(20, 40), {0.5f, 0.5f, 0.5f, 1});
  const ShownModel red = plain_model(source.mesh, {1, 0, 0, 1});
  for (const double px : {kSmallPx, kMiddlePx, kLargePx}) {
    const ReferenceViews views = reference_views(source.mesh, source.shown, px, {});
    EXPECT_EQ(views.views.size(), px == kLargePx ? 2u : 4u);
    const FlipSum same = picture_loss(views, source.scene(), {}, {}),
                  other = picture_loss(views, red.scene(), {}, {});
    EXPECT_EQ(same.mean(), 0);
    EXPECT_EQ(same.percentile(0.95), 0);
    EXPECT_GT(other.mean(), 0.2);
    EXPECT_GE(other.percentile(0.95), other.mean());
  }
}

TEST(PictureLoss, APartOfTheRowsTellsWhatAllTell) {
  const ShownModel source = plain_model(testing::sphere(20, 40), {0.5f, 0.5f, 0.5f, 1}),
                   red = plain_model(source.mesh, {0.7f, 0.4f, 0.4f, 1});
  for (const auto& [px, one_of] : {std::pair{kSmallPx, 2u}, {kLargePx, 2u}, {kLargePx, 4u}, {kHugePx, 4u}}) {
    const auto loss = [&](std::uint32_t rows) {
      return picture_loss(reference_views(source.mesh, source.shown, px, {}, rows), red.scene(), {}, {});
    };
    const FlipSum all = loss(1), part = loss(one_of);
    EXPECT_LT(static_cast<double>(part.pixels) * one_of, 0.9 * static_cast<double>(all.pixels));
    EXPECT_NEAR(part.mean() / all.mean(), 1, 0.02) << px << " " << one_of;
  }
}

TEST(PictureLoss, HalfOfTheViewsWillDoForWhatIsHopeless) {
  const ShownModel source = plain_model(testing::sphere(20, 40), {0.5f, 0.5f, 0.5f, 1});
  const ReferenceViews views = reference_views(source.mesh, source.shown, kMiddlePx, {});
  const ShownModel red = plain_model(source.mesh, {1, 0, 0, 1});
  const FlipSum all = picture_loss(views, red.scene(), {}, {}),
                near = picture_loss(views, red.scene(), {}, {}, 2 * all.mean()),
                far = picture_loss(views, red.scene(), {}, {}, 0.5 * all.mean());
  EXPECT_EQ(near.pixels, all.pixels);
  EXPECT_LT(far.pixels, 0.6 * static_cast<double>(all.pixels));
  EXPECT_GT(far.mean(), 0.5 * all.mean());
}

TEST(ShownProxy, AProxyIsShownAsItsFileSaysIt) {
  AtlasMesh atlas;
  atlas.positions = {{-1, 1, 0}, {-1, -1, 0}, {1, -1, 0}};
  atlas.uvs = {{0, 0}, {0, 1}, {1, 1}};
  atlas.position_of = {0, 1, 2};
  atlas.triangles = {{0, 1, 2}};
  atlas.group_of = {0};
  BakedMaps maps;
  maps.width_px = maps.height_px = 4;
  maps.base_colour.assign(16, {1, 0, 0});
  maps.emission.assign(16, {});
  maps.occlusion_roughness_metallic.assign(16, {1, 0.25f, 0.75f});
  maps.normal.assign(16, {0, 0, 1});
  maps.alpha.assign(16, 1);
  maps.covered.assign(16, 1);
  maps.mean_orm = maps.least_orm = {1, 0.25f, 0.75f};
  maps.most_orm = {1, 0.5f, 0.75f};
  const MaterialGroup group{false, true, AlphaMode::kOpaque};
  const auto shown = [&](const MapChoice& choice) {
    CodedPictures coded;
    return shown_proxy(atlas, rounded_mesh(atlas, std::vector<Vec3f>(3, {0, 0, 1}), {}), {group},
                       code_pictures(map_pixels(maps, choice), 100000, coded));
  };
  const ShownModel plain = shown({false, false});
  ASSERT_EQ(plain.shown.materials.size(), 1u);
  EXPECT_TRUE(plain.shown.materials[0].double_sided);
  EXPECT_EQ(plain.shown.materials[0].roughness, 0.25f);
  EXPECT_EQ(plain.shown.materials[0].metallic, 0.75f);
  EXPECT_EQ(plain.shown.textures.size(), 1u);
  const ShownModel mapped = shown({true, true});
  EXPECT_EQ(mapped.shown.materials[0].roughness, 1);
  EXPECT_EQ(mapped.shown.textures.size(), 3u);
  EXPECT_GE(mapped.shown.materials[0].slot(TextureUse::kNormal).texture, 0);
}

}  // namespace texmesh::picture_losses_test
