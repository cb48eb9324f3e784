#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/gltf_builder.h"

namespace texmesh::import_gltf_test {

using nlohmann::json;
using testing::GltfBuilder;
using testing::MemoryResolver;
using testing::quad;

ImportedModel import(const Bytes& bytes, MemoryResolver& resolver, const ImportOptions& options = {}) {
  return import_gltf("m.glb", bytes, resolver, options, {});
}
Model import(const Bytes& bytes) {
  MemoryResolver resolver;
  return import(bytes, resolver).model;
}
Model import(const GltfBuilder& b) { return import(b.glb()); }

Vec3d corner(const Mesh& mesh, std::uint32_t triangle, int i) {
  return to_double(mesh.positions[mesh.position_of(triangle, i)]) + mesh.origin;
}
Vec3d normal(const Mesh& mesh, std::uint32_t triangle) {
  const Vec3d a = corner(mesh, triangle, 0);
  return normalized(cross(corner(mesh, triangle, 1) - a, corner(mesh, triangle, 2) - a));
}
void expect_near(Vec3d a, Vec3d b, double tolerance = 1e-6) {
  EXPECT_NEAR(a.x, b.x, tolerance);
  EXPECT_NEAR(a.y, b.y, tolerance);
  EXPECT_NEAR(a.z, b.z, tolerance);
}
bool has_note(const Model& m, const std::string& code, Severity severity) {
  return std::any_of(m.notes.begin(), m.notes.end(),
                     [&](const Note& n) { return n.code == code && n.severity == severity; });
}

TEST(ImportGltf, AMemberThatIsNamedTwiceIsToldAndItsLastValueCounts) {
  const auto imported = [](const std::string& more) {
    MemoryResolver resolver;
    const GltfBuilder b = quad();
    resolver.files["a.bin"] = b.bin;
    const Bytes text = b.gltf("a.bin");
    const std::string changed = "{" + more + std::string(text.begin() + 1, text.end());
    return import_gltf("m.gltf", Bytes(changed.begin(), changed.end()), resolver, {}, {}).model;
  };
  EXPECT_FALSE(has_note(imported("\"a\":[{},[],\"{,\",[{}]],"), "duplicate-member", Severity::kWarning));
  for (const char* twice : {"\"meshes\":7,", "\"a\":[{\"b\":1,\"c\":[],\"b\":2}],", "\"a\":{},\"a\":{},"})
    EXPECT_TRUE(has_note(imported(twice), "duplicate-member", Severity::kWarning)) << twice;
}

TEST(ImportGltf, ReadsAQuad) {
  MemoryResolver resolver;
  const ImportedModel m = import(quad().glb(), resolver);
  EXPECT_EQ(m.format, "glb");
  EXPECT_TRUE(m.normals_by_specification);
  const Mesh& mesh = m.model.mesh;
  EXPECT_EQ(mesh.positions, (std::vector<Vec3f>{{0, 0, 0}, {1, 0, 0}, {1, 1, 0}, {0, 1, 0}}));
  EXPECT_EQ(mesh.wedge_position, (std::vector<std::uint32_t>{0, 1, 2, 3}));
  EXPECT_EQ(mesh.uv0, (std::vector<Vec2f>{{0, 1}, {1, 1}, {1, 0}, {0, 0}}));
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_TRUE(mesh.normals.empty() && mesh.colours.empty() && mesh.uv1.empty());
  EXPECT_EQ(mesh.origin, Vec3d{});
  EXPECT_EQ(m.model.materials.size(), 1u);
  EXPECT_TRUE(m.model.notes.empty());
  EXPECT_TRUE(resolver.asked.empty());
}

TEST(ImportGltf, ReadsBuffersFromFilesAndDataUris) {
  const GltfBuilder b = quad();
  MemoryResolver resolver;
  resolver.files["my data.bin"] = b.bin;
  resolver.files["my data.bin"].push_back(0);  // files may be longer than the buffer
  EXPECT_EQ(import(b.gltf("my%20data.bin"), resolver).model.mesh.triangles.size(), 2u);
  EXPECT_EQ(import(b.gltf("my%20data.bin"), resolver).format, "gltf");
  const std::string digits = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  for (std::size_t i = 0; i < b.bin.size(); i += 3) {
    std::uint32_t v = 0;
    for (std::size_t k = 0; k < 3; ++k) v = v << 8 | (i + k < b.bin.size() ? b.bin[i + k] : 0);
    for (int k = 3; k >= 0; --k) text += digits[v >> (6 * k) & 63];
  }
  ASSERT_EQ(b.bin.size() % 3, 2u);
  text.back() = '=';
  EXPECT_EQ(import(b.gltf("data:application/x-any;base64," + text)).mesh.triangles.size(), 2u);
}

TEST(ImportGltf, TakesIndicesOfAllTypesStridesAndOffsets) {
  for (const int bytes : {1, 2, 4}) {
    GltfBuilder b = quad();
    const std::vector<int> values{7, 0, 1, 2,
                                  0, 2, 3};  // the first is skipped by an offset that is not aligned to 4
    std::vector<std::uint8_t> raw;
    for (const int v : values) {
      for (int i = 0; i < bytes; ++i) raw.push_back(static_cast<std::uint8_t>(i == 0 ? v : 0));
    }
    const int type = bytes == 1 ? 5121 : bytes == 2 ? 5123 : 5125;
    const int indices = b.accessor(b.view_of(raw), "SCALAR", type, 6, {{"byteOffset", bytes}});
    b.json["meshes"][0]["primitives"][0]["indices"] = indices;
    EXPECT_EQ(import(b).mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}})) << bytes;
  }
}

TEST(ImportGltf, ReadsInterleavedAttributesAtAnyAlignment) {
  GltfBuilder b = quad();
  std::vector<std::uint8_t> raw(1);  // one byte off
  for (int v = 0; v < 4; ++v) {
    for (const float f : {v == 1 || v == 2 ? 1.0f : 0.0f, v >= 2 ? 1.0f : 0.0f, 5.0f, 0.25f, v * 0.5f}) {
      testing::append(raw, f);
    }
  }
  const int view = b.view_of(raw, 20);
  json& p = b.json["meshes"][0]["primitives"][0]["attributes"];
  p["POSITION"] =
      b.accessor(view, "VEC3", 5126, 4, {{"byteOffset", 1}, {"min", {0, 0, 0}}, {"max", {9, 9, 9}}});
  p["TEXCOORD_0"] = b.accessor(view, "VEC2", 5126, 4, {{"byteOffset", 13}});
  const Mesh mesh = import(b).mesh;
  EXPECT_EQ(corner(mesh, 0, 0), (Vec3d{0, 0, 5}));
  EXPECT_EQ(corner(mesh, 0, 1), (Vec3d{1, 0, 5}));
  EXPECT_EQ(corner(mesh, 1, 2), (Vec3d{0, 1, 5}));
  EXPECT_EQ(mesh.uv0, (std::vector<Vec2f>{{0.25f, 0}, {0.25f, 0.5f}, {0.25f, 1}, {0.25f, 1.5f}}));
}

template <class T>
void expect_uv(std::vector<T> values, bool normalized, std::vector<Vec2f> expected) {
  GltfBuilder b = quad();
  b.json["meshes"][0]["primitives"][0]["attributes"]["TEXCOORD_0"] =
      b.attribute<T>(values, "VEC2", {{"normalized", normalized}});
  EXPECT_EQ(import(b).mesh.uv0, expected);
}

TEST(ImportGltf, ReadsEveryComponentTypePlainAndNormalised) {
  expect_uv<std::uint8_t>({0, 255, 51, 102, 1, 2, 3, 4}, false, {{0, 255}, {51, 102}, {1, 2}, {3, 4}});
  expect_uv<std::uint8_t>({0, 255, 51, 102, 0, 0, 0, 0}, true, {{0, 1}, {0.2f, 0.4f}, {0, 0}, {0, 0}});
  expect_uv<std::int8_t>({-128, 127, -127, 0, 1, 2, 3, 4}, false, {{-128, 127}, {-127, 0}, {1, 2}, {3, 4}});
  expect_uv<std::int8_t>({-128, 127, -127, 0, 0, 0, 0, 0}, true, {{-1, 1}, {-1, 0}, {0, 0}, {0, 0}});
  expect_uv<std::uint16_t>({0, 65535, 13107, 26214, 1, 2, 3, 4}, false,
                           {{0, 65535}, {13107, 26214}, {1, 2}, {3, 4}});
  expect_uv<std::uint16_t>({0, 65535, 13107, 26214, 0, 0, 0, 0}, true,
                           {{0, 1}, {0.2f, 0.4f}, {0, 0}, {0, 0}});
  expect_uv<std::int16_t>({-32768, 32767, 1, 2, 3, 4, 5, 6}, false,
                          {{-32768, 32767}, {1, 2}, {3, 4}, {5, 6}});
  expect_uv<std::int16_t>({-32768, 32767, -32767, 0, 0, 0, 0, 0}, true, {{-1, 1}, {-1, 0}, {0, 0}, {0, 0}});
  expect_uv<float>({0, 1, -3.5f, 2, 0, 0, 0, 0}, false, {{0, 1}, {-3.5f, 2}, {0, 0}, {0, 0}});
}

TEST(ImportGltf, ReadsQuantisedPositionsThroughTheirNode) {
  GltfBuilder b = quad();
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_mesh_quantization"};
  b.json["meshes"][0]["primitives"][0]["attributes"]["POSITION"] =
      b.accessor(b.view_of<std::uint16_t>({0, 0, 0, 0, 1000, 0, 0, 0, 1000, 1000, 0, 0, 0, 1000, 0, 0}, 8),
                 "VEC3", 5123, 4, {{"min", {0, 0, 0}}, {"max", {1000, 1000, 0}}});
  b.json["nodes"][0]["scale"] = {0.002, 0.002, 0.002};
  b.json["nodes"][0]["translation"] = {1, 2, 3};
  const Mesh mesh = import(b).mesh;
  expect_near(corner(mesh, 0, 2), {3, 4, 3});
  expect_near(corner(mesh, 0, 0), {1, 2, 3});
}

TEST(ImportGltf, ReadsSparseAccessors) {
  GltfBuilder b = quad();
  const int indices = b.view_of<std::uint8_t>({1, 3});
  const int values = b.view_of<float>({7, 8, 9, 10, 11, 12});
  const json sparse = {{"count", 2},
                       {"indices", {{"bufferView", indices}, {"componentType", 5121}}},
                       {"values", {{"bufferView", values}}}};
  b.json["accessors"][0]["sparse"] = sparse;
  EXPECT_EQ(import(b).mesh.positions, (std::vector<Vec3f>{{0, 0, 0}, {7, 8, 9}, {1, 1, 0}, {10, 11, 12}}));
  b.json["accessors"][0].erase("bufferView");  // what is not given is zero
  EXPECT_EQ(import(b).mesh.positions, (std::vector<Vec3f>{{0, 0, 0}, {7, 8, 9}, {0, 0, 0}, {10, 11, 12}}));
}

TEST(ImportGltf, ReadsSparseIndices) {
  GltfBuilder b = quad();
  const int at = b.view_of<std::uint8_t>({1, 2, 4, 5});
  const int values = b.view_of<std::uint16_t>({1, 2, 2, 3});
  b.json["accessors"][2].erase("bufferView");  // glTF-Transform writes it so: most are zero
  b.json["accessors"][2]["sparse"] = {{"count", 4},
                                      {"indices", {{"bufferView", at}, {"componentType", 5121}}},
                                      {"values", {{"bufferView", values}}}};
  EXPECT_EQ(import(b).mesh.triangles, import(quad()).mesh.triangles);
}

TEST(ImportGltf, ReadsStripsFansAndUnindexedPrimitives) {
  GltfBuilder b;
  const int positions = b.attribute<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0}, "VEC3");
  b.mesh({{"POSITION", positions}}, {{"mode", 5}});
  b.node({{"mesh", 0}});
  EXPECT_EQ(import(b).mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {1, 3, 2}, {2, 3, 4}}));
  b.json["meshes"][0]["primitives"][0]["mode"] = 6;
  EXPECT_EQ(import(b).mesh.triangles, (std::vector<Triangle>{{1, 2, 0}, {2, 3, 0}, {3, 4, 0}}));
  b.json["meshes"][0]["primitives"][0]["mode"] = 4;
  const Model m = import(b);
  EXPECT_EQ(m.mesh.triangles, (std::vector<Triangle>{{0, 1, 2}}));
  EXPECT_EQ(m.mesh.positions.size(), 3u);
  EXPECT_TRUE(has_note(m, "incomplete-triangle", Severity::kWarning));
}

TEST(ImportGltf, StripsTurnAllTrianglesTheSameWay) {
  GltfBuilder b;
  const int positions = b.attribute<float>({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0, 0, 2, 0, 1, 2, 0}, "VEC3");
  b.mesh({{"POSITION", positions}}, {{"mode", 5}});
  b.node({{"mesh", 0}});
  const Mesh mesh = import(b).mesh;
  ASSERT_EQ(mesh.triangles.size(), 4u);
  for (std::uint32_t t = 0; t < 4; ++t) expect_near(normal(mesh, t), {0, 0, 1});
}

TEST(ImportGltf, LeavesOutPointsAndLinesWithANote) {
  GltfBuilder b = quad();
  json line = b.json["meshes"][0]["primitives"][0];
  line["mode"] = 1;
  b.json["meshes"][0]["primitives"].push_back(line);
  const Model m = import(b);
  EXPECT_EQ(m.mesh.triangles.size(), 2u);
  EXPECT_TRUE(has_note(m, "skipped-primitive", Severity::kInfo));
  b.json["meshes"][0]["primitives"].erase(0);
  const std::string alone = testing::input_error([&] { import(b); });
  EXPECT_NE(alone.find("expected triangles, found points and lines alone"), alone.npos) << alone;
}

TEST(ImportGltf, AppliesNodeTransformsDownTheTree) {
  GltfBuilder b = quad();
  // Half a turn about z, then twice the size, then a step: TRS of the parent; a matrix step in the child.
  b.json["nodes"] = {
      {{"children", {1}}, {"rotation", {0, 0, 2, 0}}, {"scale", {2, 2, 2}}, {"translation", {10, 0, 0}}},
      {{"mesh", 0}, {"matrix", {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 5, 6, 7, 1}}}};
  b.json["scenes"] = {{{"nodes", {0}}}};
  const Mesh mesh = import(b).mesh;
  expect_near(corner(mesh, 0, 0), {0, -12, 14});
  expect_near(corner(mesh, 0, 1), {-2, -12, 14});
  expect_near(normal(mesh, 0), {0, 0, 1});
}

TEST(ImportGltf, TurnsNormalsByTheInverseTransposeAndWindingByTheDeterminant) {
  GltfBuilder b = quad();
  b.json["meshes"][0]["primitives"][0]["attributes"]["NORMAL"] =
      b.attribute<float>({0, 1, 1, 0, 1, 1, 0, 0, 1, 0, 0, 0}, "VEC3");
  b.json["nodes"][0]["scale"] = {1, 1, 2};
  const Mesh stretched = import(b).mesh;
  expect_near(to_double(stretched.normals[0]), normalized(Vec3d{0, 1, 0.5}));
  expect_near(normal(stretched, 0), {0, 0, 1});
  expect_near(to_double(stretched.normals[3]), {0, 0, 1});  // a zero normal is made good from the triangles
  b.json["nodes"][0]["scale"] = {1, 1, -1};
  const Mesh mirrored = import(b).mesh;
  expect_near(to_double(mirrored.normals[2]), {0, 0, -1});
  expect_near(normal(mirrored, 0), {0, 0, -1});  // still the side that the normals show
  expect_near(normal(mirrored, 1), {0, 0, -1});
}

TEST(ImportGltf, KeepsMillimetresFarFromTheOrigin) {
  GltfBuilder b;
  const int positions = b.attribute<float>({0, 0, 0, 0.001f, 0, 0, 0, 0.002f, 0.001f}, "VEC3");
  b.mesh({{"POSITION", positions}});
  b.node({{"mesh", 0}, {"translation", {5e6, 4e6, 300}}});
  const Mesh mesh = import(b).mesh;
  EXPECT_NE(mesh.origin, Vec3d{});
  expect_near(corner(mesh, 0, 1) - corner(mesh, 0, 0), {0.001, 0, 0}, 1e-6);
  expect_near(corner(mesh, 0, 2) - corner(mesh, 0, 0), {0, 0.002, 0.001}, 1e-6);
  expect_near(corner(mesh, 0, 0), {5e6, 4e6, 300}, 1e-6);
}

TEST(ImportGltf, ShowsOneMeshInSeveralNodesAsParts) {
  GltfBuilder b = quad();
  b.json["meshes"][0]["name"] = "leaf";
  b.json["nodes"] = {
      {{"mesh", 0}, {"name", "left"}}, {{"mesh", 0}, {"translation", {5, 0, 0}}}, {{"name", "empty"}}};
  const Mesh mesh = import(b).mesh;
  EXPECT_EQ(mesh.part_names, (std::vector<std::string>{"left", "leaf"}));
  EXPECT_EQ(mesh.triangle_part, (std::vector<std::uint16_t>{0, 0, 1, 1}));
  EXPECT_EQ(mesh.positions.size(), 8u);
  expect_near(corner(mesh, 2, 0), {5, 0, 0});
}

TEST(ImportGltf, ShowsEveryCopyOfAnInstancedMesh) {
  GltfBuilder b = quad();
  const std::int16_t half = 23170;  // a quarter of a turn about z
  nlohmann::json attributes{{"TRANSLATION", b.attribute<float>({5, 0, 0, 0, 7, 0}, "VEC3")},
                            {"ROTATION", b.attribute<std::int16_t>({0, 0, 0, 32767, 0, 0, half, half}, "VEC4",
                                                                   {{"normalized", true}})},
                            {"SCALE", b.attribute<float>({1, 1, 1, 2, 2, 2}, "VEC3")},
                            {"_ID", b.attribute<float>({0, 1}, "SCALAR")}};
  nlohmann::json& node = b.json["nodes"][0];
  node["translation"] = {0, 0, 1};
  node["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = attributes;
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"EXT_mesh_gpu_instancing"};
  const Mesh mesh = import(b).mesh;
  ASSERT_EQ(mesh.triangles.size(), 4u);
  EXPECT_EQ(mesh.part_names.size(), 2u);
  const Vec3d to_second = corner(mesh, 0, 1) - corner(mesh, 0, 0);
  expect_near(corner(mesh, 0, 0), {5, 0, 1});
  expect_near(corner(mesh, 2, 0), {0, 7, 1});
  expect_near(corner(mesh, 2, 1) - corner(mesh, 2, 0), {-2 * to_second.y, 2 * to_second.x, 0}, 1e-3);

  const auto refused = [&](const char* name, int accessor) {
    GltfBuilder bad = b;
    bad.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"][name] = accessor;
    EXPECT_THROW(import(bad), InputError) << name;
  };
  refused("SCALE", b.attribute<float>({1, 1, 1}, "VEC3"));
  refused("ROTATION", b.attribute<float>({1, 1, 1, 1, 1, 1}, "VEC3"));
  refused("TRANSLATION", b.attribute<float>({1, 1, 1, 1, 1, std::nanf("")}, "VEC3"));
  refused("TRANSLATION", 99);
  b.json["nodes"][0]["extensions"]["EXT_mesh_gpu_instancing"]["attributes"] = {
      {"SCALE", b.accessor(-1, "VEC3", 5126, 1 << 30)}};
  EXPECT_THROW(import(b), InputError);
}

TEST(ImportGltf, LeavesHiddenNodesOutWithAllBeneathAndTells) {
  GltfBuilder b = quad();
  b.json["nodes"] = {{{"mesh", 0}, {"children", {2}}}, {{"mesh", 0}}, {{"mesh", 0}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_node_visibility"};
  json& visibility = b.json["nodes"][0]["extensions"]["KHR_node_visibility"];
  visibility["visible"] = true;
  const Model all = import(b);
  EXPECT_EQ(all.mesh.triangles.size(), 6u);
  EXPECT_FALSE(has_note(all, "hidden-nodes", Severity::kWarning));
  visibility["visible"] = false;
  const Model shown = import(b);
  EXPECT_EQ(shown.mesh.triangles.size(), 2u) << "the child of a hidden node is hidden";
  EXPECT_TRUE(has_note(shown, "hidden-nodes", Severity::kWarning));
  EXPECT_FALSE(has_note(shown, "required-extension", Severity::kWarning)) << "it is read";
  visibility["visible"] = "no";
  EXPECT_THROW(import(b), InputError);
  b.json["nodes"][0]["extensions"]["KHR_node_visibility"] = 3;
  EXPECT_THROW(import(b), InputError);
}

TEST(ImportGltf, ReadsTheDefaultSceneOrAllRoots) {
  GltfBuilder b = quad();
  b.json["nodes"] = {{{"mesh", 0}, {"children", {2}}}, {{"mesh", 0}}, {{"mesh", 0}}};
  EXPECT_EQ(import(b).mesh.triangles.size(), 6u);
  b.json["scenes"] = {{{"nodes", {0, 1}}}, {{"nodes", {1}}}};
  const Model first = import(b);
  EXPECT_EQ(first.mesh.triangles.size(), 6u);
  EXPECT_TRUE(has_note(first, "other-scenes", Severity::kInfo));
  b.json["scene"] = 1;
  EXPECT_EQ(import(b).mesh.triangles.size(), 2u);
}

TEST(ImportGltf, JoinsPrimitivesWithDifferentAttributesAndMaterials) {
  GltfBuilder b = quad();
  b.json["materials"] = {{{"name", "unused"}},
                         {{"name", "red"}, {"pbrMetallicRoughness", {{"baseColorFactor", {1, 0, 0, 1}}}}}};
  json bare = b.json["meshes"][0]["primitives"][0];
  bare["attributes"].erase("TEXCOORD_0");
  bare["attributes"]["COLOR_0"] = b.attribute<float>({0, 0.5f, 1, 0, 0.5f, 1, 2, -1, 0.25f, 0, 0, 0}, "VEC3");
  bare["material"] = 1;
  b.json["meshes"][0]["primitives"].push_back(bare);
  const Model m = import(b);
  EXPECT_EQ(m.mesh.wedge_count(), 8u);
  EXPECT_EQ(m.mesh.uv0[1], (Vec2f{1, 1}));
  EXPECT_EQ(m.mesh.uv0[5], (Vec2f{0, 0}));
  EXPECT_EQ(m.mesh.colours[1], (Vec4f{1, 1, 1, 1}));
  EXPECT_EQ(m.mesh.colours[4], (Vec4f{0, 0.5f, 1, 1}));
  EXPECT_EQ(m.mesh.colours[6], (Vec4f{1, 0, 0.25f, 1}));
  ASSERT_EQ(m.materials.size(), 2u);
  EXPECT_EQ(m.mesh.triangle_material, (std::vector<std::uint16_t>{0, 0, 1, 1}));
  EXPECT_EQ(m.materials[0], Material{});
  EXPECT_EQ(m.materials[1].name, "red");
  EXPECT_EQ(m.materials[1].base_colour, (Vec4f{1, 0, 0, 1}));
}

TEST(ImportGltf, PrimitivesWithoutNormalsAreFlatBesideOnesWithNormals) {
  GltfBuilder b = quad();
  json smooth = b.json["meshes"][0]["primitives"][0];
  smooth["attributes"]["NORMAL"] = b.attribute<float>({1, 0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0}, "VEC3");
  b.json["meshes"][0]["primitives"].push_back(smooth);
  const Mesh mesh = import(b).mesh;
  ASSERT_EQ(mesh.normals.size(), 6u + 4u);
  EXPECT_EQ(mesh.positions.size(), 8u);
  EXPECT_EQ(mesh.normals[mesh.triangles[0][0]], (Vec3f{0, 0, 1}));
  EXPECT_EQ(mesh.uv0[mesh.triangles[1][2]], (Vec2f{0, 0}));
  EXPECT_EQ(mesh.normals[mesh.triangles[2][0]], (Vec3f{1, 0, 0}));
}

TEST(ImportGltf, ReadsColoursOfEveryType) {
  const auto colour = [](auto values, const char* type) {
    GltfBuilder b = quad();
    b.json["meshes"][0]["primitives"][0]["attributes"]["COLOR_0"] =
        b.attribute(values, type, {{"normalized", true}});
    return import(b).mesh.colours[0];
  };
  EXPECT_EQ(colour(std::vector<std::uint8_t>{0, 51, 255, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC3"),
            (Vec4f{0, 0.2f, 1, 1}));
  EXPECT_EQ(
      colour(std::vector<std::uint16_t>{0, 13107, 65535, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4"),
      (Vec4f{0, 0.2f, 1, 0}));
  EXPECT_EQ(colour(std::vector<float>{0.25f, 0.5f, 1, 0.125f, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0}, "VEC4"),
            (Vec4f{0.25f, 0.5f, 1, 0.125f}));
}

TEST(ImportGltf, KeepsOnlyTheVerticesOfSharedBuffersThatAPrimitiveUses) {
  GltfBuilder b;
  std::vector<float> many(3 * 5000, 0.0f);
  for (std::size_t i = 0; i < 5000; ++i) many[3 * i] = static_cast<float>(i);
  many[3 * 4000 + 1] = 1;
  const int positions = b.attribute(many, "VEC3");
  const int indices = b.attribute<std::uint16_t>({4000, 10, 4999}, "SCALAR");
  b.mesh({{"POSITION", positions}}, {{"indices", indices}});
  b.node({{"mesh", 0}});
  const Mesh mesh = import(b).mesh;
  EXPECT_EQ(mesh.positions, (std::vector<Vec3f>{{10, 0, 0}, {4000, 1, 0}, {4999, 0, 0}}));
  EXPECT_EQ(mesh.triangles, (std::vector<Triangle>{{1, 0, 2}}));
}

TEST(ImportGltf, SoftFaultsAreWarnings) {
  GltfBuilder b = quad();
  b.json["accessors"][0].erase("min");
  EXPECT_TRUE(has_note(import(b), "accessor-without-bounds", Severity::kWarning));

  GltfBuilder nan = quad();
  const float bad = std::nanf("");
  std::memcpy(nan.bin.data() + 12 * 3, &bad, 4);  // a position of the second triangle only
  const Model m = import(nan);
  EXPECT_EQ(m.mesh.triangles.size(), 1u);
  EXPECT_TRUE(has_note(m, "non-finite-position", Severity::kWarning));

  Bytes longer = quad().glb();
  longer.resize(longer.size() + 4);
  EXPECT_FALSE(has_note(import(longer), "trailing-bytes", Severity::kWarning)) << "padding";
  longer.back() = 7;
  EXPECT_TRUE(has_note(import(longer), "trailing-bytes", Severity::kWarning));

  GltfBuilder required = quad();
  required.json["extensionsRequired"] = {"KHR_lights_punctual", "CESIUM_RTC", "KHR_materials_odd"};
  EXPECT_TRUE(has_note(import(required), "required-extension", Severity::kWarning))
      << "what leaves the surface as it is";
}

TEST(ImportGltf, ABufferMayBeShorterThanItSaysWhereNothingOfItIsMissing) {
  GltfBuilder b = quad();
  b.json["buffers"][0]["byteLength"] = b.bin.size() + 100;
  MemoryResolver resolver;
  b.json["buffers"][0]["uri"] = "b.bin";
  resolver.files["b.bin"] = b.bin;
  const std::string text = b.json.dump();
  const Model m = import_gltf("a.gltf", testing::bytes_of(text), resolver, {}, {}).model;
  EXPECT_EQ(m.mesh.triangles.size(), 2u);
  EXPECT_TRUE(has_note(m, "short-buffer", Severity::kWarning));
  resolver.files["b.bin"].resize(b.bin.size() - 4);
  try {
    import_gltf("a.gltf", testing::bytes_of(text), resolver, {}, {});
    ADD_FAILURE() << "a file that is cut off";
  } catch (const InputError& e) {
    EXPECT_NE(e.expected().find("a file that is cut off has fewer"), std::string::npos) << e.what();
  }
}

TEST(ImportGltf, SaysWhatItLeavesOut) {
  GltfBuilder b = quad();
  b.json["animations"] = json::parse(R"([{"channels":[{"broken":1}],"samplers":7}])");
  b.json["skins"] = json::parse(R"([{"joints":[99]}])");
  b.json["cameras"] = json::parse(R"([{"type":"odd"}])");
  b.json["extensionsUsed"] = {"EXT_odd", "KHR_materials_unlit"};
  b.json["meshes"][0]["primitives"][0]["targets"] = {{{"POSITION", 0}}};
  const Model m = import(b);
  EXPECT_EQ(m.mesh.triangles.size(), 2u);
  for (const char* code : {"animation", "skin", "camera", "unknown-extension", "morph-targets"}) {
    EXPECT_TRUE(has_note(m, code, Severity::kInfo)) << code;
  }
  EXPECT_EQ(m.notes.size(), 5u);
}

TEST(ImportGltf, TakesWholeFloatsAsIntegersAndNullAsAbsent) {
  GltfBuilder b = quad();
  b.json["accessors"][0]["count"] = 4.0;
  b.json["accessors"][0]["sparse"] = nullptr;
  b.json["nodes"][0]["mesh"] = 0.0;
  b.json["nodes"][0]["children"] = nullptr;
  EXPECT_EQ(import(b).mesh.triangles.size(), 2u);
}

TEST(ImportGltf, WorksOnTheSameBytesAtAnyNumberOfThreads) {
  MemoryResolver resolver;
  const Bytes bytes = quad().glb();
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(import_gltf("m", bytes, resolver, {}, {}).model,
            import_gltf("m", bytes, resolver, {}, eight).model);
}

}  // namespace texmesh::import_gltf_test
