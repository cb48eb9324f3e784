#include "stages/atlas/atlas.h"

#include <gtest/gtest.h>

#include "stages/atlas/atlas_parts.h"
#include "stages/base/run_context.h"
#include "stages/charts/texture_frame.h"
#include "stages/condition/condition.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/image/decode_image.h"
#include "stages/simplification/simplification.h"
#include "tests/stages/atlas/atlas_fixtures.h"

namespace texmesh::atlas_test {

using testing::data_material, testing::image_of, testing::in_charts, testing::Pixel, testing::places,
    testing::scattered;

struct Charted {
  ConditionedMesh source;
  ChartedModel made;
};
Charted charted(const Mesh& mesh, const std::vector<Material>& materials, const std::vector<Image>& images,
                AtlasMode mode = AtlasMode::kRebuild, int threads = 1) {
  RunContext context;
  context.threads = threads;
  Charted out;
  out.source = condition_mesh(mesh, false, {}, context);
  AtlasOptions options;
  options.mode = mode;
  out.made = chart_model(out.source, materials, images, options, context);
  return out;
}

Vec2f middle(const Mesh& mesh, const Triangle& t) {
  return (mesh.uv0[t[0]] + mesh.uv0[t[1]] + mesh.uv0[t[2]]) * (1 / 3.f);
}

/// Triangle by triangle the source's surface, with coordinates in the texture and materials that are there.
void expect_same_surface(const Charted& c) {
  const Mesh &before = c.source.mesh, &after = c.made.mesh.mesh;
  ASSERT_EQ(after.triangles.size(), before.triangles.size());
  EXPECT_EQ(after.positions, before.positions);
  EXPECT_EQ(after.triangle_part, before.triangle_part);
  for (std::uint32_t t = 0; t < before.triangles.size(); ++t) {
    ASSERT_LT(after.triangle_material[t], c.made.materials.size());
    for (int k = 0; k < 3; ++k) {
      ASSERT_EQ(after.position_of(t, k), before.position_of(t, k));
      const std::uint32_t old = before.triangles[t][std::size_t(k)], now = after.triangles[t][std::size_t(k)];
      if (!before.normals.empty()) ASSERT_EQ(after.normals[now], before.normals[old]);
      if (!before.colours.empty()) ASSERT_EQ(after.colours[now], before.colours[old]);
      ASSERT_TRUE(after.uv0[now].x >= 0 && after.uv0[now].x <= 1);
      ASSERT_TRUE(after.uv0[now].y >= 0 && after.uv0[now].y <= 1);
    }
  }
  for (Material m : c.made.materials)
    for_each_texture(m, [&](const TextureRef& r) { EXPECT_LT(r.image, std::int32_t(c.made.images.size())); });
  for (const Image& image : c.made.images) EXPECT_LE(image.width_px, 8192u);
}

TEST(Atlas, ScatteredTrianglesBecomeFewCharts) {
  const Charted c = charted(scattered(testing::bumpy_sphere(20, 30)), {data_material(0)}, {places(512)});
  expect_same_surface(c);
  ASSERT_EQ(c.made.images.size(), 1u);
  const Mesh& mesh = c.made.mesh.mesh;
  EXPECT_LT(double(mesh.wedge_count()), 1.5 * double(mesh.positions.size()));
  EXPECT_GT(double(c.source.mesh.wedge_count()), 5 * double(mesh.positions.size()));
}

TEST(Atlas, TexelsAreThoseOfTheSameTriangle) {
  const Charted c = charted(scattered(testing::bumpy_sphere(10, 14)), {data_material(0)}, {places(512)});
  const Pixels texels = decode_image(c.made.images.at(0));
  for (std::uint32_t t = 0; t < c.source.mesh.triangles.size(); ++t) {
    const Vec2f from = middle(c.source.mesh, c.source.mesh.triangles[t]),
                at = middle(c.made.mesh.mesh, c.made.mesh.mesh.triangles[t]);
    const std::uint8_t* texel = texels.at(static_cast<std::uint32_t>(at.x * float(texels.width_px)),
                                          static_cast<std::uint32_t>(at.y * float(texels.height_px)));
    EXPECT_NEAR(texel[0], from.x * 255, 2) << t;
    EXPECT_NEAR(texel[1], from.y * 255, 2) << t;
  }
}

TEST(Atlas, NormalsPointWhereTheyDid) {
  Material material;
  material.normal_texture.image = 0;
  const Vec3d tilted = normalized(Vec3d{0.5, 0.2, 0.9});
  const auto code = [](double x) { return static_cast<std::uint8_t>(std::lround((x / 2 + 0.5) * 255)); };
  const Image map = image_of(256, [&](std::uint32_t, std::uint32_t) {
    return Pixel{code(tilted.x), code(tilted.y), code(tilted.z)};
  });
  const Charted c = charted(scattered(testing::bumpy_sphere(8, 10)), {material}, {map});
  const Pixels texels = decode_image(c.made.images.at(0));
  const auto shown = [](const Mesh& mesh, std::uint32_t t, Vec3d value) {
    const std::array<Vec3d, 3> corner = corner_points(mesh, mesh.triangles[t]);
    std::array<Vec2d, 3> uv;
    Vec3d normal;
    for (std::size_t k = 0; k < 3; ++k) {
      uv[k] = to_double(mesh.uv0[mesh.triangles[t][k]]);
      normal = normal + to_double(mesh.normals[mesh.triangles[t][k]]);
    }
    normal = normalized(normal);
    const TextureFrame frame = texture_frame(corner, uv, normal);
    return normalized(frame.along_u * value.x + frame.along_v * value.y + normal * value.z);
  };
  for (std::uint32_t t = 0; t < c.source.mesh.triangles.size(); ++t) {
    const Vec2f at = middle(c.made.mesh.mesh, c.made.mesh.mesh.triangles[t]);
    const std::uint8_t* texel = texels.at(static_cast<std::uint32_t>(at.x * float(texels.width_px)),
                                          static_cast<std::uint32_t>(at.y * float(texels.height_px)));
    const Vec3d value{texel[0] / 127.5 - 1, texel[1] / 127.5 - 1, texel[2] / 127.5 - 1};
    EXPECT_GT(dot(shown(c.source.mesh, t, tilted), shown(c.made.mesh.mesh, t, value)), 0.995) << t;
  }
}

TEST(Atlas, MaterialsThatDifferInImagesAloneBecomeOne) {
  Mesh mesh = scattered(testing::cube());
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) mesh.triangle_material[t] = std::uint16_t(t % 3);
  std::vector<Material> materials{data_material(0), data_material(1), data_material(1)};
  materials[1].name = "another name";
  const auto same = charted(mesh, materials, {places(128), places(256)});
  expect_same_surface(same);
  EXPECT_EQ(same.made.materials.size(), 1u);
  materials[2].roughness = 0.5f;
  const auto apart = charted(mesh, materials, {places(128), places(256)});
  expect_same_surface(apart);
  EXPECT_EQ(apart.made.materials.size(), 2u);
  materials[2] = {};
  const auto plain = charted(mesh, materials, {places(128), places(256)});
  expect_same_surface(plain);
  EXPECT_EQ(plain.made.materials.size(), 2u);
  EXPECT_EQ(plain.made.images.size(), 1u);
}

TEST(Atlas, TheCoarsestScaleIsSmallForAnyNumberOfCharts) {
  for (const std::uint32_t charts : {20u, 1000u, 5000u}) {
    const Charted c =
        charted(in_charts(testing::bumpy_sphere(50, 60), charts), {data_material(0)}, {places(256)});
    ScaleMap map;
    map.scales = 12;
    testing::Random random{charts};
    for (std::size_t p = 0; p < c.made.mesh.mesh.positions.size(); ++p)
      map.persistence.push_back(static_cast<std::uint8_t>(random.next() % 13));
    SimplificationOptions options;
    options.order = CollapseOrder::kTouching;
    options.seam_weight = 0.1;
    options.coarsest_vertices = 220;
    const NestedScales scales = simplify(c.made.mesh, map, options, RunContext{});
    EXPECT_LE(scales.scales.back().triangles.size(), 600u) << charts;
    EXPECT_GE(scales.scales.size(), 4u) << charts;
  }
}

TEST(Atlas, KeepsWhatItCannotOrNeedNotRebuild) {
  const Mesh mesh = scattered(testing::cube());
  const auto is_kept = [](const Charted& c) {
    return c.made.mesh.mesh == c.source.mesh && c.made.images.size() == 1 && c.made.images[0].name == "a.png";
  };
  EXPECT_TRUE(is_kept(charted(mesh, {data_material(0)}, {places(64)}, AtlasMode::kKeep)));
  EXPECT_TRUE(is_kept(charted(mesh, {data_material(0)}, {places(64)}, AtlasMode::kAuto)));
  EXPECT_TRUE(is_kept(charted(mesh, {Material{}}, {places(64)})));
  Material nearest = data_material(0);
  nearest.metallic_roughness_texture.nearest = true;
  EXPECT_TRUE(is_kept(charted(mesh, {nearest}, {places(64)})));
  Mesh bare = mesh;
  bare.uv0.clear();
  EXPECT_TRUE(is_kept(charted(bare, {data_material(0)}, {places(64)})));
  EXPECT_FALSE(is_kept(charted(mesh, {data_material(0)}, {places(64)})));
}

TEST(Atlas, SameBytesForAnyThreadCount) {
  const Mesh mesh = scattered(testing::bumpy_sphere(12, 18));
  const auto one = charted(mesh, {data_material(0)}, {places(256)}),
             many = charted(mesh, {data_material(0)}, {places(256)}, AtlasMode::kRebuild, 8);
  EXPECT_EQ(one.made.mesh.mesh, many.made.mesh.mesh);
  EXPECT_EQ(one.made.materials, many.made.materials);
  EXPECT_EQ(one.made.images, many.made.images);
}

TEST(Atlas, AlphaStaysBesideMaterialsWithoutTextures) {
  Mesh mesh = scattered(testing::bumpy_sphere(8, 10));
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t)
    mesh.triangle_material[t] = std::uint16_t(t % 3 == 0);  // scraps without a texture among the others
  Pixels clear{64, 64, 4, {}};
  for (std::size_t i = 0; i < 64 * 64; ++i) clear.data.insert(clear.data.end(), {200, 100, 50, 77});
  Material glass;
  glass.base_colour_texture.image = 0;
  glass.alpha_mode = AlphaMode::kBlend;
  const Image image{"a.png", ImageFormat::kPng, 64, 64, 4, 8, false, false, write_png(clear)};
  const Charted c = charted(mesh, {glass, Material{}}, {image});
  expect_same_surface(c);
  ASSERT_EQ(c.made.images.size(), 1u);
  EXPECT_NE(c.made.images[0].name, "a.png");
  const Pixels texels = decode_image(c.made.images[0]);
  ASSERT_EQ(texels.channels, 4u);
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Material& made = c.made.materials[c.made.mesh.mesh.triangle_material[t]];
    const bool textured = c.source.mesh.triangle_material[t] == 0;
    EXPECT_EQ(made.base_colour_texture.used(), textured);
    if (!textured) continue;
    EXPECT_EQ(made.alpha_mode, AlphaMode::kBlend);
    const Vec2f at = middle(c.made.mesh.mesh, c.made.mesh.mesh.triangles[t]);
    EXPECT_EQ(texels.at(std::uint32_t(at.x * float(texels.width_px)),
                        std::uint32_t(at.y * float(texels.height_px)))[3],
              77);
  }
}

/// As 8k textures do beyond 8192 px, in small.
TEST(Atlas, WhatNoPageHoldsIsSharedOut) {
  constexpr std::uint32_t kMost = 64;
  const ConditionedMesh mesh =
      condition_mesh(scattered(testing::bumpy_sphere(20, 30)), false, {}, RunContext{});
  const std::vector<Image> images{places(512)};
  const MaterialClasses classes = find_classes({data_material(0)}, images);
  const auto pages = place_charts(mesh, classes, images, 1, RunContext{}, kMost);
  ASSERT_TRUE(pages);
  EXPECT_GT(pages->pages.size(), 1u);
  std::vector<std::size_t> triangles(pages->pages.size(), 0);
  for (const std::uint32_t page : pages->page_of) ++triangles.at(page);
  for (std::size_t p = 0; p < pages->pages.size(); ++p) {
    EXPECT_LE(pages->pages[p].side_px, kMost);
    EXPECT_EQ(pages->pages[p].triangles.size(), triangles[p]);
  }
  for (const std::uint32_t v : pages->vertex_of) {
    const Vec2f uv = pages->uvs.at(v);
    EXPECT_TRUE(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1);
  }
}

TEST(Atlas, WarnsOfTexturesThatRepeatMoreOftenThanItHasRoomFor) {
  for (const float times : {1.f, 5.f}) {
    Mesh mesh = scattered(testing::bumpy_sphere(10, 14));
    for (Vec2f& uv : mesh.uv0) uv = uv * times;
    const Charted c = charted(mesh, {data_material(0)}, {places(64)});
    ASSERT_NE(c.made.images.at(0).name, "a.png");
    EXPECT_EQ(std::ranges::count(c.made.notes, "atlas-blurred", &Note::code), times > 1) << times;
  }
}

TEST(Atlas, TellsAGainWhereChartsGotFewerAlone) {
  const auto told = [](const Mesh& mesh, float times) {
    Mesh repeated = mesh;
    for (Vec2f& uv : repeated.uv0) uv = uv * times;
    std::string all;
    for (const Note& n : charted(repeated, {data_material(0)}, {places(64)}).made.notes) all += n.text + "\n";
    return all;
  };
  const std::string fewer = told(scattered(testing::bumpy_sphere(10, 14)), 1);
  EXPECT_NE(fewer.find("take fewer bytes"), std::string::npos) << fewer;
  EXPECT_EQ(fewer.find("saves nothing"), std::string::npos) << fewer;
  const std::string more = told(testing::bumpy_sphere(10, 14), 60);
  EXPECT_NE(more.find("for 1, so it saves nothing: --atlas keep"), std::string::npos) << more;
  EXPECT_NE(more.find("has less than 1 % of the texels"), std::string::npos) << more;
}

TEST(Atlas, StrangeModelsAreRebuiltOrKept) {
  const std::vector<Mesh> meshes = testing::strange_models();
  for (std::size_t i = 0; i < meshes.size(); ++i)
    for (const std::uint32_t side_px : {1u, 33u}) {
      SCOPED_TRACE(i);
      const Charted c = charted(meshes[i], {data_material(0)}, {places(side_px)});
      if (c.made.images.at(0).name == "a.png")
        EXPECT_EQ(c.made.mesh.mesh, c.source.mesh);
      else
        expect_same_surface(c);
    }
}

}  // namespace texmesh::atlas_test
