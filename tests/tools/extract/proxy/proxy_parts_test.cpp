// Proxies taken apart: coarser meshes, smaller pictures, maps left out.
#include "tools/extract/proxy/proxy_search.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"

namespace texmesh::proxy_parts_test {

using Use = ProxyMap::Use;
using testing::GltfBuilder;
constexpr DracoSteps kSteps{0.01, 0.001, 8};

int add_texture(GltfBuilder& b, const Bytes& file) {
  const int image = b.push("images", {{"bufferView", b.view_of(file)}, {"mimeType", "image/png"}});
  return b.push("textures", {{"source", image}});
}

Bytes plain_png(int side, const std::vector<std::uint8_t>& texel) {
  std::vector<std::uint8_t> all;
  for (int i = 0; i < side * side; ++i) all.insert(all.end(), texel.begin(), texel.end());
  return testing::encode_image("png", side, side, static_cast<int>(texel.size()), all, OIIO::TypeDesc::UINT8);
}

/// A quad with a base colour of 200, occlusion 0.2, roughness 0.6, metal 0.4, a normal map and emission.
GltfBuilder all_maps() {
  GltfBuilder b = testing::quad();
  nlohmann::json m;
  m["normalTexture"] = {{"index", add_texture(b, plain_png(16, {128, 128, 255}))}};
  m["pbrMetallicRoughness"]["baseColorTexture"] = {{"index", add_texture(b, plain_png(16, {200, 200, 200}))}};
  m["pbrMetallicRoughness"]["roughnessFactor"] = 0.5;
  const int data = add_texture(b, plain_png(16, {51, 153, 102}));
  m["pbrMetallicRoughness"]["metallicRoughnessTexture"] = {{"index", data}};
  m["occlusionTexture"] = {{"index", data}};
  m["emissiveTexture"] = {{"index", add_texture(b, plain_png(8, {9, 9, 9}))}};
  m["emissiveFactor"] = {1, 0.5, 0};
  b.push("materials", m);
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  b.json["nodes"][0]["scale"] = {2, 2, 2};
  b.json["accessors"][0]["max"] = {1, 1, 0};
  b.json["scenes"] = {{{"nodes", {0}}}};
  b.json["scene"] = 0;
  return b;
}

Model imported(const Bytes& glb) {
  NoFiles none;
  return import_gltf("x.glb", glb, none, {}, {}).model;
}

void expect_valid(const Bytes& glb) {
  Findings findings;
  check_glb(glb, "x.glb", findings, GlbRules::kStandalone);
  for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
}

TEST(ProxyParts, AFileWithAllMapsIsTheProxyUnderDraco) {
  const auto parts = ProxyParts::read(all_maps().glb(), "proxy", {});
  ASSERT_TRUE(parts);
  EXPECT_TRUE(parts->has(Use::kData) && parts->has(Use::kNormal) && parts->has(Use::kEmission));
  EXPECT_NEAR(parts->extent(), 2, 1e-6);
  const StandaloneGlb file = parts->file({}, parts->coded(0, kSteps, {}));
  EXPECT_TRUE(file.has_draco());
  EXPECT_EQ(file.source_images(), (std::vector<std::uint32_t>{0, 1, 2, 3}));
  const Bytes glb = file.finish();
  expect_valid(glb);
  const Model before = imported(all_maps().glb()), after = imported(glb);
  ASSERT_EQ(after.mesh.triangles.size(), 2u);
  const Material &a = before.materials[0], &b = after.materials[0];
  EXPECT_EQ(a.roughness, b.roughness);
  EXPECT_EQ(a.emissive, b.emissive);
  EXPECT_TRUE(b.normal_texture.used() && b.occlusion_texture.used() && b.metallic_roughness_texture.used());
  float most = 0;
  for (const Vec3f p : after.mesh.positions) most = std::max(most, p.x);
  EXPECT_NEAR(most, 2, 0.01);  // the node's scale is in the positions
  const std::vector<ProxyMap> maps = parts->maps({});
  ASSERT_EQ(maps.size(), 4u);
  EXPECT_EQ(maps[0].use, Use::kBaseColour);
  EXPECT_EQ(maps[0].pixels.data[0], 200);
  EXPECT_EQ(maps[1].use, Use::kData);
  EXPECT_EQ(maps[2].use, Use::kNormal);
  EXPECT_EQ(maps[3].pixels.width_px, 8u);
}

TEST(ProxyParts, WithoutDataItsMeansStandAndOcclusionIsInTheColours) {
  const auto parts = ProxyParts::read(all_maps().glb(), "proxy", {});
  ASSERT_TRUE(parts);
  const ProxyMapChoice choice{false, false};
  const Bytes glb = parts->file(choice, parts->coded(0, kSteps, {})).finish();
  expect_valid(glb);
  const Material m = imported(glb).materials[0];
  EXPECT_FALSE(m.normal_texture.used() || m.occlusion_texture.used() || m.metallic_roughness_texture.used());
  EXPECT_NEAR(m.roughness, 0.5 * 0.6, 1e-3);
  EXPECT_NEAR(m.metallic, 0.4, 1e-3);
  const std::vector<ProxyMap> maps = parts->maps(choice);
  ASSERT_EQ(maps.size(), 2u);
  EXPECT_EQ(maps[1].use, Use::kEmission);
  // 200 is .578 of light; of that 1 - .5 (1 - .2) = .6 is left, .347, which is 159.
  EXPECT_EQ(maps[0].pixels.data[0], 159);
}

TEST(ProxyParts, PicturesTakeAnyShare) {
  ProxyMap map{Use::kBaseColour, {8, 16, 4, std::vector<std::uint8_t>(8 * 16 * 4, 77)}};
  const Pixels half = smaller_map(map, 0.5);
  EXPECT_EQ(half.width_px, 4u);
  EXPECT_EQ(half.height_px, 8u);
  EXPECT_EQ(half.channels, 4u);
  EXPECT_EQ(half.data, std::vector<std::uint8_t>(4 * 8 * 4, 77));
  EXPECT_EQ(smaller_map(map, 0.01).width_px, 4u);
  EXPECT_EQ(smaller_map(map, 1).data, map.pixels.data);
  map.pixels = {2, 2, 3, std::vector<std::uint8_t>(12, 5)};
  EXPECT_EQ(smaller_map(map, 0.1).width_px, 2u);
}

/// all_maps() whose coordinates count texels, with a transform that brings them back to 0..1.
GltfBuilder scaled_coordinates() {
  GltfBuilder b = all_maps();
  b.json["accessors"][1]["bufferView"] = b.view_of(std::vector<float>{0, 16, 16, 16, 16, 0, 0, 0});
  nlohmann::json& m = b.json["materials"][0];
  for (nlohmann::json* slot : {&m["normalTexture"], &m["occlusionTexture"], &m["emissiveTexture"],
                               &m["pbrMetallicRoughness"]["baseColorTexture"],
                               &m["pbrMetallicRoughness"]["metallicRoughnessTexture"]})
    (*slot)["extensions"]["KHR_texture_transform"]["scale"] = {0.0625, 0.0625};
  b.json["extensionsUsed"] = {"KHR_texture_transform"};
  return b;
}

TEST(ProxyParts, AScaleOfTextureCoordinatesIsInTheCoordinates) {
  const auto parts = ProxyParts::read(scaled_coordinates().glb(), "proxy", {});
  ASSERT_TRUE(parts);
  const Bytes glb = parts->file({}, parts->coded(0, kSteps, {})).finish();
  expect_valid(glb);
  const Model m = imported(glb);
  EXPECT_TRUE(m.materials[0].base_colour_texture.transform.is_identity());
  float most = 0;
  for (const Vec2f uv : m.mesh.uv0) most = std::max(most, uv.x);
  EXPECT_NEAR(most, 1, 0.01);
  GltfBuilder mixed = scaled_coordinates();
  mixed.json["materials"][0]["normalTexture"].erase("extensions");
  EXPECT_FALSE(ProxyParts::read(mixed.glb(), "proxy", {}));
  GltfBuilder moved = scaled_coordinates();
  moved.json["materials"][0]["normalTexture"]["extensions"]["KHR_texture_transform"]["offset"] = {0.5, 0};
  EXPECT_FALSE(ProxyParts::read(moved.glb(), "proxy", {}));
}

TEST(ProxyParts, WhatCannotBeTakenApartIsLeft) {
  GltfBuilder two_nodes = all_maps();
  two_nodes.json["scenes"][0]["nodes"].push_back(two_nodes.node({{"mesh", 0}}));
  EXPECT_FALSE(ProxyParts::read(two_nodes.glb(), "proxy", {}));
  GltfBuilder two_bases = all_maps();
  two_bases.push("materials",
                 {{"pbrMetallicRoughness",
                   {{"baseColorTexture", {{"index", add_texture(two_bases, plain_png(4, {1, 2, 3}))}}}}}});
  nlohmann::json primitive = two_bases.json["meshes"][0]["primitives"][0];
  primitive["material"] = 1;
  two_bases.json["meshes"][0]["primitives"].push_back(primitive);
  EXPECT_FALSE(ProxyParts::read(two_bases.glb(), "proxy", {}));
  GltfBuilder grey = all_maps();
  add_texture(grey, plain_png(4, {7}));
  grey.json["materials"][0]["normalTexture"]["index"] = grey.json["textures"].size() - 1;
  EXPECT_FALSE(ProxyParts::read(grey.glb(), "proxy", {}));
  Bytes broken = all_maps().glb();
  broken.resize(broken.size() / 2);
  EXPECT_THROW(ProxyParts::read(broken, "proxy", {}), FormatError);
}

}  // namespace texmesh::proxy_parts_test
