#include "stages/fragmentation/fragmentation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "stages/fragmentation/fragment_grid.h"
#include "tests/stages/fragmentation/fragmentation_inputs.h"
#include "tests/stages/geometry/texel_triangles.h"

namespace texmesh::fragmentation_test {

using namespace testing;  // NOLINT: fixtures

TEST(Fragmentation, AFullyUsedTexture) {
  const ConditionedMesh mesh = conditioned(testing::sheet(20));
  const Fragments out = run_fragmentation(mesh, {with_base(0)}, {image_of(300, 270)});
  ASSERT_EQ(out.planes.size(), 2u);  // and a mip
  const TexturePlane& p = out.planes[0];
  EXPECT_EQ(p.role, TextureRole::kBaseColour);
  EXPECT_EQ(p.channels, 3u);
  EXPECT_EQ(p.columns * p.rows, 4u);
  EXPECT_EQ(std::accumulate(p.covered_texels.begin(), p.covered_texels.end(), 0u), 300u * 270u);
  EXPECT_NEAR(total(p.surface_fraction), 1, 1e-6);
  ASSERT_EQ(p.features.size(), 4u * 4u);
  ASSERT_EQ(p.eta.size(), 16u);
  // Every position lies in one fragment or on a border between two or four of them; counts fall with the
  // scale.
  const std::uint32_t all = std::accumulate(p.features.begin(), p.features.begin() + 4, 0u);
  EXPECT_GE(all, 441u);
  EXPECT_LE(all, 441u + 42u);
  for (std::size_t k = 4; k < 16; ++k) EXPECT_LE(p.features[k], p.features[k - 4]);
  for (std::size_t s = 0; s < 4; ++s) {
    const auto [lo, hi] = std::minmax_element(p.eta.begin() + static_cast<std::ptrdiff_t>(s) * 4,
                                              p.eta.begin() + static_cast<std::ptrdiff_t>(s) * 4 + 4);
    EXPECT_EQ(*lo, 0.0f);
    EXPECT_TRUE(*hi == 1.0f || *hi == 0.0f);
  }
}

TEST(Fragmentation, FeaturesAgainstBruteForce) {
  const ConditionedMesh mesh = conditioned(testing::bumpy_sphere(13, 17));
  const ScaleMap map = scale_map(mesh.mesh);
  const TexturePlane p = run_fragmentation(mesh, {with_base(0)}, {image_of(1000, 700)}).planes[0];
  const FragmentGrid grid{1000, 700, p.fragment_width_px, p.fragment_height_px, p.columns, p.rows, ""};
  const std::size_t fragments = p.fragment_count();
  std::vector<std::vector<bool>> in(mesh.mesh.positions.size(), std::vector<bool>(fragments));
  for (std::size_t t = 0; t < mesh.mesh.triangles.size(); ++t) {
    Corners c;
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2f uv = mesh.mesh.uv0[mesh.mesh.triangles[t][k]];
      c[k] = {uv.x * 1000.0, uv.y * 700.0};
    }
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec2d inside = c[k] * 0.9999 + (c[0] + c[1] + c[2]) * (0.0001 / 3);
      in[mesh.mesh.position_of(static_cast<std::uint32_t>(t), static_cast<int>(k))]
        [fragment_at(grid, inside, Wrap::kRepeat, Wrap::kRepeat)] = true;
    }
  }
  for (std::size_t s = 0; s < 4; ++s)
    for (std::size_t f = 0; f < fragments; ++f) {
      std::uint32_t expected = 0;
      for (std::size_t v = 0; v < in.size(); ++v) expected += in[v][f] && map.crossing[v] >= s;
      EXPECT_EQ(p.features[s * fragments + f], expected) << s << ' ' << f;
    }
}

TEST(Fragmentation, TwinsCountAsOnePosition) {
  Mesh mesh = testing::sheet(2);
  ConditionedMesh apart = conditioned(mesh);
  // The second triangle gets positions of its own at the same places.
  for (std::size_t c = 0; c < 3; ++c) {
    const std::uint32_t wedge = mesh.triangles[1][c], position = mesh.wedge_position[wedge];
    apart.mesh.positions.push_back(mesh.positions[position]);
    apart.twin.push_back(position);
    apart.mesh.wedge_position.push_back(static_cast<std::uint32_t>(apart.mesh.positions.size() - 1));
    apart.mesh.uv0.push_back(mesh.uv0[wedge]);
    apart.mesh.triangles[1][c] = static_cast<std::uint32_t>(apart.mesh.wedge_position.size() - 1);
  }
  const auto once =
      run_fragmentation(conditioned(mesh), {with_base(0)}, {image_of(64, 64)}).planes[0].features;
  const auto split = run_fragmentation(apart, {with_base(0)}, {image_of(64, 64)}).planes[0].features;
  EXPECT_EQ(once[0], 9u);
  EXPECT_EQ(split[0], 9u);
}

TEST(Fragmentation, SurfaceFractionIsThatOfTheTexturedPart) {
  Mesh mesh = testing::side_by_side({testing::cube(), testing::sheet(4, 0)});
  for (std::size_t t = 12; t < mesh.triangles.size(); ++t) mesh.triangle_material[t] = 1;
  const Fragments out = run_fragmentation(conditioned(mesh), {with_base(0), with_base(1)},
                                          {image_of(256, 256), image_of(512, 512)});
  ASSERT_EQ(out.planes.size(), 5u);  // the first image has one mip, the second two
  EXPECT_NEAR(total(out.planes[0].surface_fraction), 24.0 / 25, 1e-5);
  EXPECT_NEAR(total(out.planes[1].surface_fraction), 1.0 / 25, 1e-5);
  // The cube's atlas leaves gaps.
  const auto covered =
      std::accumulate(out.planes[0].covered_texels.begin(), out.planes[0].covered_texels.end(), 0u);
  EXPECT_LT(covered, 256u * 256u);
  EXPECT_GT(covered, 6u * 76u * 115u);
  for (std::size_t f = 0; f < out.planes[0].fragment_count(); ++f)
    EXPECT_TRUE(out.planes[0].covered_texels[f] > 0 || out.planes[0].surface_fraction[f] == 0);
}

TEST(Fragmentation, TexturesOfExtensionsAreColoursOrData) {
  Material m = with_base(0);
  const auto texture = [](const char* key, int image) {
    ExtensionTexture t;
    t.key = key;
    t.texture.image = image;
    return t;
  };
  m.extensions = {
      {"KHR_materials_clearcoat", {}, {texture("clearcoatTexture", 1), texture("clearcoatNormalTexture", 2)}},
      {"KHR_materials_sheen", {}, {texture("sheenColorTexture", 3), texture("sheenRoughnessTexture", 3)}},
      {"KHR_materials_specular", {}, {texture("specularTexture", 0)}},
      {"EXT_unheard_of", {}, {texture("anyTexture", 4)}}};
  std::vector<Image> images(5, image_of(64, 64, 4));
  const Fragments out = run_fragmentation(conditioned(testing::sheet(4)), {m}, images);
  using Role = TextureRole;
  const std::vector<std::pair<std::uint32_t, Role>> want{{0, Role::kBaseColour}, {0, Role::kAlpha},
                                                         {1, Role::kData},       {2, Role::kNormal},
                                                         {3, Role::kColour},     {3, Role::kAlpha}};
  ASSERT_EQ(out.planes.size(), want.size());
  for (std::size_t p = 0; p < want.size(); ++p) {
    EXPECT_EQ(out.planes[p].image, want[p].first) << p;
    EXPECT_EQ(out.planes[p].role, want[p].second) << p;
  }
}

TEST(Fragmentation, RolesChannelsAndSharing) {
  const ConditionedMesh mesh = conditioned(testing::sheet(4));
  Material m = with_base(0);
  m.alpha_mode = AlphaMode::kMask;
  m.normal_texture.image = 1;
  m.metallic_roughness_texture.image = 2;
  m.occlusion_texture.image = 2;
  m.emissive_texture.image = 3;
  Material other = with_base(1);  // the normal map as colour too
  const Fragments out = run_fragmentation(
      mesh, {m, other},
      {image_of(256, 256, 4), image_of(256, 256), image_of(256, 256), image_of(64, 64, 2), image_of(8, 8)});
  ASSERT_EQ(out.planes.size(), 9u);  // four of them mips
  const auto is = [&](std::size_t p, std::uint32_t image, TextureRole role, std::uint32_t channels) {
    EXPECT_EQ(out.planes[p].image, image);
    EXPECT_EQ(out.planes[p].role, role);
    EXPECT_EQ(out.planes[p].channels, channels);
  };
  is(0, 0, TextureRole::kBaseColour, 3);
  is(1, 0, TextureRole::kAlpha, 1);
  is(2, 1, TextureRole::kBaseColour, 3);
  is(3, 2, TextureRole::kOcclusionRoughnessMetallic, 3);
  is(4, 3, TextureRole::kEmissive, 1);
  EXPECT_EQ(out.planes[0].coverage, out.planes[3].coverage);
  EXPECT_EQ(out.planes[0].features, out.planes[3].features);
  ASSERT_EQ(out.notes.size(), 1u);
  EXPECT_EQ(out.notes[0].code, "image-with-several-roles");
  EXPECT_EQ(out.notes[0].text, "coded as base-colour, used as normal too");

  m.alpha_mode = AlphaMode::kOpaque;
  EXPECT_EQ(
      run_fragmentation(mesh, {m, other},
                        {image_of(256, 256, 4), image_of(256, 256), image_of(256, 256), image_of(64, 64, 2)})
          .planes.size(),
      7u);  // three of them mips
}

/// A wall of n x n tiles of one image beside a square that shows another image once.
TEST(Fragmentation, EveryRepeatOfATilingTextureCounts) {
  for (const int n : {1, 4, 7}) {
    Mesh mesh = testing::sheet(n * 4, 0);  // corners at quarters of the tiles
    for (Vec2f& uv : mesh.uv0) uv = uv * static_cast<float>(n);
    ConditionedMesh wall = conditioned(mesh);
    const TexturePlane p = run_fragmentation(wall, {with_base(0)}, {image_of(512, 512)}).planes[0];
    EXPECT_NEAR(total(p.surface_fraction), 1, 1e-5);
    // Each fragment gets its share of every repeat, and the features of all of them.
    const auto [lo, hi] = std::minmax_element(p.surface_fraction.begin(), p.surface_fraction.end());
    EXPECT_NEAR(*lo, *hi, 1e-5);
    const auto features = std::accumulate(
        p.features.begin(), p.features.begin() + static_cast<std::ptrdiff_t>(p.fragment_count()), 0u);
    EXPECT_GE(features, mesh.positions.size());
  }
}

TEST(Fragmentation, FarCoordinatesAreBoundedWork) {
  for (const Wrap wrap : kWraps) {
    Mesh mesh = testing::sheet(60);
    for (Vec2f& uv : mesh.uv0) uv = {uv.x * 2e6f - 1e6f, uv.y * 2e6f - 1e6f};
    Material m = with_base(0);
    m.base_colour_texture.wrap_s = m.base_colour_texture.wrap_t = wrap;
    const std::vector<Image> images{image_of(15, 4097), image_of(1, 1)};
    EXPECT_NEAR(total(run_fragmentation(conditioned(mesh), {m}, images).planes[0].surface_fraction), 1, 1e-4);
    // 33,333 tiles beside each other, each within the first fragment: not clipped one by one, but counted
    // evenly. Clamped ones have no tiles.
    for (std::size_t k = 0; k < mesh.uv0.size(); ++k) mesh.uv0[k].y = 0.01f * static_cast<float>(k / 61) / 60;
    const TexturePlane p = run_fragmentation(conditioned(mesh), {m}, images).planes[0];
    ASSERT_GT(p.rows, 8u);
    for (std::uint32_t row = 0; row < p.rows; ++row) {
      const double height = std::min(p.fragment_height_px, p.height_px - row * p.fragment_height_px);
      EXPECT_NEAR(p.surface_fraction[row], wrap == Wrap::kClamp ? row == 0 : height / p.height_px, 1e-4);
    }
  }
}

TEST(Fragmentation, EtaIsMinMaxOverCoveredFragments) {
  Mesh mesh = testing::sheet(20);
  for (Vec2f& uv : mesh.uv0) uv = {uv.x * 0.45f + 0.01f, uv.y * 0.45f + 0.01f};  // to 236 of 512 px
  const TexturePlane p = run_fragmentation(conditioned(mesh), {with_base(0)}, {image_of(512, 512)}).planes[0];
  ASSERT_EQ(p.fragment_count(), 16u);
  for (std::size_t scale = 0; scale < 4; ++scale) {
    std::uint32_t lo = 0xffffffff, hi = 0;
    for (std::size_t f = 0; f < 16; ++f) {
      const std::uint32_t features = p.features[scale * 16 + f];
      ASSERT_EQ(p.covered_texels[f] > 0, f % 4 < 2 && f < 8);
      if (p.covered_texels[f] > 0) lo = std::min(lo, features), hi = std::max(hi, features);
    }
    ASSERT_GE(lo, 3u);
    ASSERT_GT(hi, lo);
    for (std::size_t f = 0; f < 16; ++f)
      EXPECT_FLOAT_EQ(
          p.eta[scale * 16 + f],
          p.covered_texels[f] > 0 ? static_cast<float>(p.features[scale * 16 + f] - lo) / (hi - lo) : 0);
  }
}

TEST(Fragmentation, AMaterialThatSamplesAnImageTwiceHasItsSurfaceOnce) {
  Mesh mesh = testing::sheet(4, 0);
  mesh.uv1 = mesh.uv0;
  for (Vec2f& uv : mesh.uv1) uv = {uv.x * 0.4f + 0.5f, uv.y * 0.4f + 0.5f};
  Material m;
  m.metallic_roughness_texture.image = m.occlusion_texture.image = 0;
  m.occlusion_texture.texcoord = 1;
  const Fragments out = run_fragmentation(conditioned(mesh), {m}, {image_of(512, 512)});
  EXPECT_EQ(out.planes[0].role, TextureRole::kOcclusionRoughnessMetallic);
  for (const TexturePlane& p : out.planes) EXPECT_NEAR(total(p.surface_fraction), 1, 1e-5);
}

}  // namespace texmesh::fragmentation_test
