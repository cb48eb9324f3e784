#include "stages/proxies/bake/bake.h"

#include <gtest/gtest.h>

#include <cmath>

#include "format/base/portable_math.h"
#include "tests/stages/proxies/atlas_fixtures.h"
#include "tests/support/even_sphere.h"

namespace texmesh::bake_test {

using testing::square_atlas;
using testing::texture_of;
using testing::use_texture;

constexpr std::size_t kManySamples = 1 << 20;

/// S_0 with materials, and what is baked of it.
struct Baked {
  Mesh mesh;
  ShownMaterials shown;
  BakedMaps maps(const AtlasMesh& atlas, int threads = 1) const {
    RunContext context;
    context.threads = threads;
    const MaterialGroups groups = find_groups(mesh, shown.materials);
    const BakeSource source(mesh, shown, groups);
    const SmoothMesh smooth = sampled_normals(atlas, source, CreaseUse::kAll, context);
    return bake(smooth.mesh, smooth.normals, source, {kManySamples}, context);
  }
};

Baked red_green_square() {
  Baked out{testing::square(), {}};
  out.shown.textures.push_back(
      texture_of(16, 3, true, [](auto x, auto, auto c) { return (x < 8) == (c == 0) && c < 2 ? 255 : 0; }));
  out.shown.materials.push_back(RenderMaterial{});
  use_texture(out.shown.materials[0], TextureUse::kBaseColour, 0);
  return out;
}

TEST(Bake, AnEqualSquareHasTheSourcesTexels) {
  const BakedMaps maps = red_green_square().maps(square_atlas(16));
  for (std::size_t i = 0; i < maps.covered.size(); ++i) {
    EXPECT_TRUE(maps.covered[i]);
    const bool left = i % 16 < 8;
    EXPECT_NEAR(maps.base_colour[i].x, left ? 1 : 0, i % 16 == 7 || i % 16 == 8 ? 0.3 : 1e-5) << i;
    EXPECT_NEAR(maps.base_colour[i].y, left ? 0 : 1, i % 16 == 7 || i % 16 == 8 ? 0.3 : 1e-5) << i;
    EXPECT_NEAR(maps.normal[i].z, 1, 1e-5);
  }
  EXPECT_FALSE(maps.has_alpha);
  EXPECT_FALSE(maps.has_emission);
}

TEST(Bake, FactorsAndVertexColoursAreMultipliedIn) {
  Baked source = red_green_square();
  source.shown.materials[0].base_colour = {0.5f, 0.5f, 0.5f, 1};
  source.mesh.colours.assign(4, {0.5f, 1, 1, 1});
  const BakedMaps maps = source.maps(square_atlas(16));
  EXPECT_NEAR(maps.base_colour[0].x, 0.25, 1e-5);
  EXPECT_NEAR(maps.base_colour[15].y, 0.5, 1e-5);
}

TEST(Bake, ATexelIsTheMeanOfLightNotOfCodes) {
  Baked source{testing::square(), {}};
  source.shown.textures.push_back(
      texture_of(64, 3, true, [](auto x, auto y, auto) { return (x + y) % 2 ? 255 : 0; }));
  source.shown.materials.push_back(RenderMaterial{});
  use_texture(source.shown.materials[0], TextureUse::kBaseColour, 0);
  for (const Vec3f c : source.maps(square_atlas(4)).base_colour) EXPECT_NEAR(c.x, 0.5, 0.02);
}

/// Two walls, so many apart, that look away from each other: red to the front, green to the back.
Baked thin_shell(float thickness) {
  Baked out{testing::square(), {}};
  Mesh back = testing::square();
  for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
  for (Vec3f& n : back.normals) n = {0, 0, -1};
  out.mesh = testing::joined(out.mesh, back, 1, {0, 0, -thickness});
  out.mesh.triangle_part.assign(4, 0);
  out.shown.materials = {testing::plain({1, 0, 0, 1}), testing::plain({0, 1, 0, 1})};
  return out;
}

TEST(Bake, WallsOfAThinShellShowThemselvesAndNotEachOther) {
  const Baked shell = thin_shell(0.01f);
  for (const float z : {0.02f, 0.0f, -0.005f, -0.01f, -0.03f}) {
    for (const Vec3f c : shell.maps(square_atlas(8, 0, z)).base_colour) EXPECT_EQ(c, (Vec3f{1, 0, 0})) << z;
    AtlasMesh back = square_atlas(8, 0, z);
    for (Triangle& t : back.triangles) std::swap(t[1], t[2]);
    for (const Vec3f c : shell.maps(back).base_colour) EXPECT_EQ(c, (Vec3f{0, 1, 0})) << z;
  }
}

TEST(Bake, WhatLiesBeyondTheCageIsFoundByTheNearestPoint) {
  const BakedMaps maps = red_green_square().maps(square_atlas(16, 0, 1.5f));
  EXPECT_NEAR(maps.base_colour[0].x, 1, 1e-5);
  EXPECT_NEAR(maps.base_colour[15].y, 1, 1e-5);
}

TEST(Bake, ANormalMapOfTheSourceIsThatOfTheAtlas) {
  Baked source{testing::square(), {}};
  source.shown.textures.push_back(texture_of(4, 3, false, [](auto, auto, auto c) {
    return std::array<int, 3>{204, 128, 230}[c];  // (0.6, 0, 0.8)
  }));
  source.shown.materials.push_back(RenderMaterial{});
  use_texture(source.shown.materials[0], TextureUse::kNormal, 0);
  AtlasMesh atlas = square_atlas(8);
  const MaterialGroups groups = find_groups(source.mesh, source.shown.materials);
  const BakeSource bake_source(source.mesh, source.shown, groups);
  const BakedMaps maps = bake(atlas, std::vector<Vec3f>(4, {0, 0, 1}), bake_source, {kManySamples}, {});
  for (const Vec3f n : maps.normal) {
    EXPECT_NEAR(n.x, 0.6, 0.01);
    EXPECT_NEAR(n.y, 0, 0.01);
  }
  // An atlas that is turned by a quarter has the map turned.
  for (Vec2f& uv : atlas.uvs) uv = {uv.y, 1 - uv.x};
  const BakedMaps turned = bake(atlas, std::vector<Vec3f>(4, {0, 0, 1}), bake_source, {kManySamples}, {});
  for (const Vec3f n : turned.normal) {
    EXPECT_NEAR(n.x, 0, 0.01);
    EXPECT_NEAR(n.y, 0.6, 0.01);
  }
}

TEST(Bake, AMaskIsThePartThatIsThereAndHiddenColoursLeaveNoTrace) {
  Baked source{testing::square(), {}};
  source.shown.textures.push_back(texture_of(32, 4, true, [](auto x, auto, auto c) {
    return c == 3 ? (x % 4 < 2 ? 255 : 0) : (x % 4 < 2 ? 255 : c == 0 ? 0 : 255);
  }));
  source.shown.materials.push_back(RenderMaterial{});
  source.shown.materials[0].alpha_mode = AlphaMode::kMask;
  use_texture(source.shown.materials[0], TextureUse::kBaseColour, 0);
  source.shown.materials[0].slot(TextureUse::kBaseColour).mag_filter = MagFilter::kNearest;
  const BakedMaps maps = source.maps(square_atlas(8));
  EXPECT_TRUE(maps.has_alpha);
  for (std::size_t i = 0; i < maps.alpha.size(); ++i) {
    EXPECT_NEAR(maps.alpha[i], 0.5, 0.13);
    EXPECT_GT(maps.base_colour[i].x, 0.9f) << "the hidden texels are not red";
  }
}

TEST(Bake, GroupsShowOnlyTheirOwnTriangles) {
  Baked source = thin_shell(-0.01f);  // the green one in front
  for (std::size_t t = 2; t < 4; ++t) std::swap(source.mesh.triangles[t][1], source.mesh.triangles[t][2]);
  source.shown.materials[1].double_sided = true;
  const MaterialGroups groups = find_groups(source.mesh, source.shown.materials);
  ASSERT_EQ(groups.groups.size(), 2u);
  for (const Vec3f c : source.maps(square_atlas(4, 0, 0.02f)).base_colour) EXPECT_EQ(c, (Vec3f{1, 0, 0}));
  for (const Vec3f c : source.maps(square_atlas(4, 1, 0.02f)).base_colour) EXPECT_EQ(c, (Vec3f{0, 1, 0}));
}

TEST(Bake, CoordinatesWithoutAreaAndTrianglesWithoutAreaDoNoHarm) {
  Baked source = red_green_square();
  for (Vec2f& uv : source.mesh.uv0) uv = {0.25f, 0.25f};
  source.mesh.triangles.push_back({0, 0, 1});
  source.mesh.triangle_material.push_back(0);
  source.mesh.triangle_part.push_back(0);
  use_texture(source.shown.materials[0], TextureUse::kNormal, 0);
  for (const Vec3f c : source.maps(square_atlas(4)).base_colour) EXPECT_EQ(c, (Vec3f{1, 0, 0}));
  AtlasMesh atlas = square_atlas(4);
  for (Vec2f& uv : atlas.uvs) uv = {0.5f, 0.5f};
  const BakedMaps maps = source.maps(atlas);
  for (const Vec3f n : maps.normal) EXPECT_TRUE(std::isfinite(n.x) && std::isfinite(n.y) && n.z > 0);
}

TEST(Bake, FarFromTheOriginItIsTheSame) {
  Baked source = red_green_square();
  AtlasMesh atlas = square_atlas(16);
  for (Vec3f& p : source.mesh.positions) p = p + Vec3f{1e7f, -1e7f, 1e7f};
  for (Vec3f& p : atlas.positions) p = p + Vec3f{1e7f, -1e7f, 1e7f};
  const BakedMaps maps = source.maps(atlas);
  EXPECT_NEAR(maps.base_colour[0].x, 1, 1e-5);
  EXPECT_NEAR(maps.base_colour[15].y, 1, 1e-5);
}

/// A sphere by even triangles as a soup of one chart a triangle, cells in rows.
AtlasMesh sphere_atlas(const Mesh& sphere, std::uint32_t side_px) {
  AtlasMesh out;
  const auto cells = static_cast<std::uint32_t>(std::ceil(std::sqrt(sphere.triangles.size())));
  const float cell = 1.0f / static_cast<float>(cells);
  for (std::uint32_t t = 0; t < sphere.triangles.size(); ++t) {
    const Vec2f corner{static_cast<float>(t % cells) * cell, static_cast<float>(t / cells) * cell};
    for (std::uint32_t k = 0; k < 3; ++k) {
      out.positions.push_back(sphere.positions[sphere.position_of(t, static_cast<int>(k))]);
      out.position_of.push_back(sphere.position_of(t, static_cast<int>(k)));
      out.uvs.push_back(corner +
                        std::array<Vec2f, 3>{Vec2f{0.1f, 0.9f}, {0.9f, 0.9f}, {0.1f, 0.1f}}[k] * cell);
    }
    out.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
    out.chart_of.push_back(t);
    out.group_of.push_back(0);
  }
  out.width_px = out.height_px = side_px;
  return out;
}

TEST(Bake, ManyThreadsGiveTheBitsOfOne) {
  Baked source{testing::bumpy_sphere(40, 80), {}};
  source.shown.textures.push_back(
      texture_of(64, 3, true, [](auto x, auto y, auto c) { return (x * 37 + y * 91 + c * 50) & 255; }));
  source.shown.materials.push_back(RenderMaterial{});
  use_texture(source.shown.materials[0], TextureUse::kBaseColour, 0);
  use_texture(source.shown.materials[0], TextureUse::kNormal, 0);
  const AtlasMesh atlas = sphere_atlas(testing::even_sphere(2, 0), 64);
  const BakedMaps one = source.maps(atlas, 1), eight = source.maps(atlas, 8);
  EXPECT_EQ(one.base_colour, eight.base_colour);
  EXPECT_EQ(one.normal, eight.normal);
  EXPECT_EQ(one.occlusion_roughness_metallic, eight.occlusion_roughness_metallic);
}

TEST(SampledNormals, ThoseOfASphereAreItsRadii) {
  Baked source{testing::sphere(60, 120), {}};
  source.shown.materials.push_back(RenderMaterial{});
  const MaterialGroups groups = find_groups(source.mesh, source.shown.materials);
  const AtlasMesh atlas = sphere_atlas(testing::even_sphere(3, 0), 64);
  const auto [smooth, normals] =
      sampled_normals(atlas, BakeSource(source.mesh, source.shown, groups), CreaseUse::kAll, {});
  EXPECT_EQ(smooth, atlas) << "a sphere has no creases";
  for (std::size_t v = 0; v < normals.size(); ++v)
    EXPECT_GT(dot(normals[v], normalized(atlas.positions[v])), 0.995f) << v;
  for (std::size_t v = 0; v < normals.size(); ++v)
    for (std::size_t w = 0; w < v; ++w)
      if (atlas.position_of[v] == atlas.position_of[w]) {
        EXPECT_EQ(normals[v], normals[w]);
      }
}

TEST(SampledNormals, HardEdgesHaveNormalsOfTheirOwnOnBothSides) {
  Baked source{testing::cube(), {}};
  source.shown.materials.push_back(RenderMaterial{});
  const MaterialGroups groups = find_groups(source.mesh, source.shown.materials);
  const BakeSource bake_source(source.mesh, source.shown, groups);
  AtlasMesh atlas;  // one chart, whose vertices all sides share
  atlas.positions = source.mesh.positions;
  atlas.uvs.resize(atlas.positions.size());
  for (std::uint32_t v = 0; v < atlas.positions.size(); ++v) atlas.position_of.push_back(v);
  for (std::uint32_t t = 0; t < source.mesh.triangles.size(); ++t)
    atlas.triangles.push_back(
        {source.mesh.position_of(t, 0), source.mesh.position_of(t, 1), source.mesh.position_of(t, 2)});
  atlas.chart_of.assign(atlas.triangles.size(), 0);
  atlas.group_of.assign(atlas.triangles.size(), 0);
  const auto [mesh, normals] = sampled_normals(atlas, bake_source, CreaseUse::kAll, {});
  EXPECT_EQ(mesh.positions.size(), 3 * atlas.positions.size());
  for (const Triangle& t : mesh.triangles) {
    const Vec3f a = mesh.positions[t[0]],
                face = normalized(cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a));
    for (const std::uint32_t v : t) EXPECT_GT(dot(normals[v], face), 0.999f);
  }
  EXPECT_EQ(sampled_normals(atlas, bake_source, CreaseUse::kWhereChartsEnd, {}).mesh, atlas);
}

}  // namespace texmesh::bake_test
