#include "stages/proxies/coding/proxy_glb.h"

#include <gtest/gtest.h>

#include <string>

#include "stages/gltf/check_glb.h"
#include "stages/image/webp.h"
#include "tests/stages/proxies/atlas_fixtures.h"
#include "tests/support/meshes.h"

namespace texmesh::proxy_glb_test {

BakedMaps noise_maps(std::uint32_t side_px, bool alpha) {
  testing::Random random{11};
  BakedMaps out;
  out.width_px = out.height_px = side_px;
  for (std::uint32_t i = 0; i < side_px * side_px; ++i) {
    const auto value = [&] { return static_cast<float>(random.uniform()); };
    out.base_colour.push_back({value(), value(), value()});
    out.emission.push_back({value() * 2, 0, 0});
    out.occlusion_roughness_metallic.push_back({value(), value(), value()});
    out.normal.push_back(normalized(Vec3f{value() - 0.5f, value() - 0.5f, 1}));
    out.alpha.push_back(alpha ? value() : 1);
    out.covered.push_back(1);
  }
  out.mean_orm = {0.5f, 0.4f, 0.3f};
  out.most_orm = {1, 1, 1};
  out.most_emission = {2, 0, 0};
  out.has_emission = true;
  out.has_alpha = alpha;
  return out;
}

ProxyPictures pictures_of(const MapPixels& maps, std::size_t most_bytes) {
  CodedPictures coded;
  return code_pictures(maps, most_bytes, coded);
}

const std::vector<Vec3f> kUp(4, Vec3f{0, 0, 1});

std::string json_of(const Bytes& glb) {
  return {glb.begin() + 20, glb.begin() + 20 + glb[12] + (glb[13] << 8) + (glb[14] << 16)};
}

GlbFacts checked(const Bytes& glb) {
  Findings findings;
  const GlbFacts facts = check_glb(glb, "proxy", findings, GlbRules::kStandalone);
  EXPECT_TRUE(findings.list().empty()) << (findings.list().empty() ? "" : findings.list().front().found);
  return facts;
}

TEST(ProxyGlb, StandsAloneWithItsPictures) {
  const AtlasMesh atlas = testing::square_atlas(32);
  const CodedMesh mesh = code_mesh(atlas, kUp, {true}, {});
  const ProxyPictures pictures = pictures_of(map_pixels(noise_maps(32, false), {true, true}), 6000);
  const Bytes glb = proxy_glb(mesh, {MaterialGroup{}}, pictures);
  const GlbFacts facts = checked(glb);
  EXPECT_EQ(facts.triangles, 2u);
  EXPECT_EQ(facts.vertices, 4u);
  EXPECT_EQ(facts.codec, "meshopt");
  EXPECT_EQ(facts.image_names.size(), 4u);
  EXPECT_EQ(facts.largest_image_px, 32u);
  ASSERT_EQ(facts.positions.size(), 4u);
  EXPECT_NEAR(facts.positions[0].x, -1, 1e-3);
  EXPECT_NEAR(facts.positions[3].y, 1, 1e-3);
  const std::string json = json_of(glb);
  for (const char* part : {"normalTexture", "occlusionTexture", "metallicRoughnessTexture", "emissiveFactor"})
    EXPECT_NE(json.find(part), std::string::npos) << part;
  EXPECT_NE(json.find("KHR_texture_transform"), std::string::npos);
}

TEST(ProxyGlb, DracosMeshIsTheSameInFloats) {
  const AtlasMesh atlas = testing::square_atlas(32);
  const CodedMesh mesh = code_mesh(atlas, kUp, {true}, {true, 12});
  ASSERT_EQ(mesh.groups.size(), 1u);
  EXPECT_TRUE(mesh.groups[0].is_draco());
  const Bytes glb =
      proxy_glb(mesh, {MaterialGroup{}}, pictures_of(map_pixels(noise_maps(32, false), {}), 6000));
  const GlbFacts facts = checked(glb);
  EXPECT_EQ(facts.codec, "draco");
  EXPECT_EQ(facts.triangles, 2u);
  EXPECT_EQ(facts.vertices, 4u);
  ASSERT_EQ(facts.positions.size(), 4u);
  EXPECT_NEAR(facts.positions[0].x, -1, 1e-3);
  EXPECT_NEAR(facts.positions[3].y, 1, 1e-3);
  const std::string json = json_of(glb);
  for (const char* part : {"meshopt", "KHR_texture_transform", "KHR_mesh_quantization"})
    EXPECT_EQ(json.find(part), std::string::npos) << part;
  EXPECT_NE(json.find("NORMAL"), std::string::npos);
}

TEST(ProxyMesh, RoundedCoordinatesAreWithinAnEighthOfATexel) {
  AtlasMesh atlas = testing::square_atlas(20);
  atlas.uvs = {{0.123f, 0.877f}, {0.5f, 0.031f}, {0.999f, 0.35f}, {0, 1}};
  for (const bool draco : {false, true}) {
    const RoundedMesh rounded = rounded_mesh(atlas, kUp, {draco, 12});
    for (std::size_t v = 0; v < 4; ++v) {
      EXPECT_NEAR(rounded.uvs[v].x * 20, atlas.uvs[v].x * 20, 0.126);
      EXPECT_NEAR(rounded.uvs[v].y * 20, atlas.uvs[v].y * 20, 0.126);
    }
  }
}

TEST(ProxyGlb, GroupsAreMaterialsOverTheSamePictures) {
  AtlasMesh atlas = testing::square_atlas(16);
  atlas.group_of = {0, 1};
  const std::vector<MaterialGroup> groups{{false, true, AlphaMode::kMask}, {true, false, AlphaMode::kOpaque}};
  const CodedMesh mesh = code_mesh(atlas, kUp, {true, false}, {});
  ASSERT_EQ(mesh.groups.size(), 2u);
  EXPECT_FALSE(mesh.groups[1].has_normals) << "an unlit material needs no normals";
  const Bytes glb = proxy_glb(mesh, groups, pictures_of(map_pixels(noise_maps(16, true), {}), 100000));
  EXPECT_EQ(checked(glb).primitives, 2u);
  const std::string json = json_of(glb);
  for (const char* part : {"MASK", "doubleSided", "KHR_materials_unlit", "EXT_texture_webp"})
    EXPECT_NE(json.find(part), std::string::npos) << part;
}

TEST(ProxyPictures, FillTheBytesAndNoMore) {
  const MapPixels maps = map_pixels(noise_maps(128, false), {true, true});
  for (const std::size_t bytes : {30000u, 50000u}) {
    const ProxyPictures pictures = pictures_of(maps, bytes);
    EXPECT_LE(pictures.bytes(), bytes);
    EXPECT_GT(pictures.bytes(), bytes * 9 / 10);
  }
  const std::size_t least = pictures_of(maps, 0).bytes();
  EXPECT_GT(least, 0u);
  EXPECT_LT(least, 30000u);
}

TEST(ProxyPictures, ASecondChoiceTakesOverWhatTheFirstHasCoded) {
  const BakedMaps maps = noise_maps(128, false);
  CodedPictures coded;
  const ProxyPictures all = code_pictures(map_pixels(maps, {true, true}), 30000, coded);
  const std::size_t first = coded.images[0].size(), normals = coded.images[2].size();
  const ProxyPictures less = code_pictures(map_pixels(maps, {true, false}), 30000, coded);
  EXPECT_LE(less.bytes(), 30000u);
  EXPECT_GT(less.bytes(), 28000u);
  EXPECT_GT(less.quality, all.quality);
  EXPECT_FALSE(less.normal);
  EXPECT_EQ(coded.images[2].size(), normals);
  EXPECT_LE(first, 4u) << "encodes of a search";
  EXPECT_LE(coded.images[0].size(), first + 3);
  const MapPixels pixels = map_pixels(maps, {true, false});
  EXPECT_EQ(less.base_colour.file,
            encode_webp(pixels.base_colour, {static_cast<float>(less.quality), less.quality}));
}

TEST(ProxyPictures, HalfOfTheOcclusionIsInTheColourWhereItHasNoMap) {
  BakedMaps maps = noise_maps(8, false);
  for (Vec3f& c : maps.base_colour) c = {1, 1, 1};
  for (Vec3f& orm : maps.occlusion_roughness_metallic) orm.x = 0;
  const std::uint8_t shaded = map_pixels(maps, {false, false}).base_colour.data[0];
  EXPECT_EQ(shaded, 188) << "light .5";
  EXPECT_EQ(map_pixels(maps, {true, false}).base_colour.data[0], 255);
}

TEST(ProxyPictures, AMapOfOneValueIsAFactor) {
  BakedMaps maps = noise_maps(8, false);
  maps.mean_orm = maps.least_orm = maps.most_orm = {1, 0.4f, 0.3f};
  for (Vec3f& orm : maps.occlusion_roughness_metallic) orm = maps.mean_orm;
  const ProxyPictures pictures = pictures_of(map_pixels(maps, {true, false}), 100000);
  EXPECT_FALSE(pictures.orm);
  EXPECT_EQ(pictures.roughness, 0.4f);
}

TEST(ProxyMesh, TrianglesThatTheGridFlattensGo) {
  AtlasMesh atlas = testing::square_atlas(16);
  atlas.positions.push_back({-1, 1 - 1e-6f, 0});
  atlas.uvs.push_back({0, 0.01f});
  atlas.position_of.push_back(4);
  atlas.triangles.push_back({0, 4, 2});
  atlas.group_of.push_back(0);
  const CodedMesh mesh = code_mesh(atlas, std::vector<Vec3f>(5, Vec3f{0, 0, 1}), {true}, {false, 11});
  ASSERT_EQ(mesh.groups.size(), 1u);
  EXPECT_EQ(mesh.groups[0].triangles(), 2u);
  EXPECT_EQ(mesh.groups[0].vertices(), 4u);
}

TEST(WebpPicture, AlphaComesBack) {
  Pixels rgba{8, 8, 4, {}};
  for (std::uint32_t i = 0; i < 64; ++i)
    rgba.data.insert(rgba.data.end(), {200, 100, 50, i < 32 ? std::uint8_t{255} : std::uint8_t{0}});
  const Pixels back = decode_webp_rgba(encode_webp(rgba, {80, 80}));
  ASSERT_EQ(back.data.size(), rgba.data.size());
  EXPECT_EQ(back.data[3], 255);
  EXPECT_EQ(back.data[63 * 4 + 3], 0);
  EXPECT_NEAR(back.data[0], 200, 12);
}

}  // namespace texmesh::proxy_glb_test
