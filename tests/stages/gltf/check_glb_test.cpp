#include <draco/compression/encode.h>
#include <draco/mesh/triangle_soup_mesh_builder.h>
#include <gtest/gtest.h>
#include <meshoptimizer.h>

#include <cstring>

#include "stages/gltf/check_glb.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"

namespace texmesh::check_glb_test {

using nlohmann::json;

using testing::GlbParts;

Bytes small_jpeg() {
  return encode_jpeg(Pixels{8, 8, 3, std::vector<std::uint8_t>(192, 90)}, 80, Subsampling::k444);
}

GlbParts good() { return testing::make_glb(testing::cube(), small_jpeg()); }

struct Checked {
  GlbFacts facts;
  std::vector<Finding> findings;
  std::string text;
};
Checked check(const Bytes& glb) {
  Findings findings;
  Checked c;
  c.facts = check_glb(glb, "mesh/s00.glb", findings);
  c.findings = findings.release();
  for (const Finding& f : c.findings) c.text += to_string(f) + "\n";
  return c;
}

/// One finding, of that check and in that field.
::testing::AssertionResult finds(const Bytes& glb, const std::string& check_name, const std::string& field) {
  const Checked c = check(glb);
  if (c.findings.size() == 1 && c.findings[0].check == check_name && c.findings[0].field == field)
    return ::testing::AssertionSuccess();
  return ::testing::AssertionFailure() << check_name << " in " << field << " is not what was found:\n"
                                       << c.text;
}
::testing::AssertionResult finds(const std::function<void(json&)>& change, const std::string& check_name,
                                 const std::string& field) {
  GlbParts g = good();
  change(g.json);
  return finds(g.glb(), check_name, field);
}

/// The cube's geometry as one Draco buffer in place of its accessors' data.
GlbParts draco_cube() {
  const Mesh mesh = testing::cube();
  draco::TriangleSoupMeshBuilder builder;
  builder.Start(static_cast<int>(mesh.triangles.size()));
  const int position = builder.AddAttribute(draco::GeometryAttribute::POSITION, 3, draco::DT_FLOAT32);
  const int uv = builder.AddAttribute(draco::GeometryAttribute::TEX_COORD, 2, draco::DT_FLOAT32);
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    const auto face = draco::FaceIndex(static_cast<std::uint32_t>(t));
    const auto p = [&](std::size_t c) {
      return &mesh.positions[mesh.wedge_position[mesh.triangles[t][c]]].x;
    };
    const auto q = [&](std::size_t c) { return &mesh.uv0[mesh.triangles[t][c]].x; };
    builder.SetAttributeValuesForFace(position, face, p(0), p(1), p(2));
    builder.SetAttributeValuesForFace(uv, face, q(0), q(1), q(2));
  }
  const auto coded = builder.Finalize();
  draco::EncoderBuffer buffer;
  draco::Encoder encoder;
  if (!encoder.EncodeMeshToBuffer(*coded, &buffer).ok()) throw std::runtime_error("Draco does not encode");
  GlbParts g = testing::make_glb(mesh, {});
  g.binary.assign(buffer.data(), buffer.data() + buffer.size());
  g.json["buffers"][0]["byteLength"] = g.binary.size();
  g.json["bufferViews"] = {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", g.binary.size()}}};
  for (json& a : g.json["accessors"]) a.erase("bufferView");
  g.json["accessors"][0]["count"] = g.json["accessors"][1]["count"] = coded->num_points();
  g.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"] = {
      {"bufferView", 0},
      {"attributes",
       {{"POSITION", coded->attribute(0)->unique_id()}, {"TEXCOORD_0", coded->attribute(1)->unique_id()}}}};
  g.json["extensionsUsed"] = g.json["extensionsRequired"] = {"KHR_draco_mesh_compression"};
  return g;
}

/// The cube with its positions and indices as meshopt streams.
GlbParts meshopt_cube() {
  const Mesh mesh = testing::cube();
  GlbParts g = testing::make_glb(mesh, {});
  const auto compress = [&](std::size_t view, const char* mode, std::size_t stride, std::size_t count,
                            const Bytes& data) {
    json& v = g.json["bufferViews"][view];
    v["extensions"]["EXT_meshopt_compression"] = {{"buffer", 0},
                                                  {"byteOffset", g.binary.size()},
                                                  {"byteLength", data.size()},
                                                  {"byteStride", stride},
                                                  {"count", count},
                                                  {"mode", mode}};
    v["buffer"] = 1;
    g.binary.insert(g.binary.end(), data.begin(), data.end());
    while (g.binary.size() % 4) g.binary.push_back(0);
  };
  const std::size_t raw = g.binary.size();
  const std::size_t vertices = mesh.wedge_count(), indices = mesh.triangles.size() * 3;
  Bytes coded(meshopt_encodeVertexBufferBound(vertices, 12));
  coded.resize(meshopt_encodeVertexBuffer(coded.data(), coded.size(), g.binary.data(), vertices, 12));
  compress(0, "ATTRIBUTES", 12, vertices, coded);
  coded.assign(meshopt_encodeIndexBufferBound(indices, vertices), 0);
  coded.resize(meshopt_encodeIndexBuffer(coded.data(), coded.size(), &mesh.triangles[0][0], indices));
  compress(2, "TRIANGLES", 4, indices, coded);
  g.json["buffers"] = {{{"byteLength", g.binary.size()}}, {{"byteLength", raw}}};
  g.json["extensionsUsed"] = g.json["extensionsRequired"] = {"EXT_meshopt_compression"};
  return g;
}

TEST(CheckGlb, ReadsWhatIsThere) {
  const Checked c = check(good().glb());
  EXPECT_EQ(c.text, "");
  EXPECT_EQ(c.facts.triangles, 12u);
  EXPECT_EQ(c.facts.vertices, testing::cube().wedge_count());
  EXPECT_EQ(c.facts.codec, "none");
  EXPECT_EQ(c.facts.image_names, std::vector<std::string>{"texture/0"});
  EXPECT_EQ(c.facts.bounds_max, (Vec3d{1, 1, 1}));
}

TEST(CheckGlb, AppliesNodeTransforms) {
  GlbParts g = good();
  g.json["nodes"] = {{{"children", {1}}, {"translation", {10, 0, 0}}},
                     {{"mesh", 0}, {"scale", {2, 1, 1}}, {"rotation", {0, 0, 1, 0}}}};
  const Checked c = check(g.glb());
  EXPECT_EQ(c.text, "");
  EXPECT_EQ(c.facts.bounds_min, (Vec3d{8, -1, -1}));
  EXPECT_EQ(c.facts.bounds_max, (Vec3d{12, 1, 1}));
}

TEST(CheckGlb, EveryTruncationIsFound) {
  const Bytes glb = good().glb();
  for (std::size_t n = 0; n < glb.size(); n += n < 64 ? 1 : 37)
    EXPECT_FALSE(check(Bytes(glb.begin(), glb.begin() + static_cast<std::ptrdiff_t>(n))).findings.empty())
        << n;
}

TEST(CheckGlb, FlippedBytesDoNoHarm) {
  for (const Bytes& glb : {good().glb(), draco_cube().glb(), meshopt_cube().glb()})
    for (std::size_t i = 0; i < glb.size(); ++i) {
      Bytes broken = glb;
      broken[i] ^= static_cast<std::uint8_t>(1u << (i % 8));
      check(broken);  // says something or nothing, but neither throws nor reads beyond
    }
}

TEST(CheckGlb, Container) {
  Bytes glb = good().glb();
  glb[0] = 'x';
  EXPECT_TRUE(finds(glb, "glb-container", "byte 0"));
  glb = good().glb();
  glb[4] = 1;
  EXPECT_TRUE(finds(glb, "glb-container", "byte 4"));
  glb = good().glb();
  glb.push_back(0);
  EXPECT_TRUE(finds(glb, "glb-container", "byte 8"));
  GlbParts g = good();
  g.json["buffers"][0]["byteLength"] = g.binary.size() + 400;
  EXPECT_TRUE(finds(g.glb(), "glb-container", "/buffers/0/byteLength"));
}

TEST(CheckGlb, Json) {
  EXPECT_TRUE(finds([](json& j) { j["asset"]["version"] = "1.0"; }, "glb-json", "/asset/version"));
  EXPECT_TRUE(finds([](json& j) { j["extensionsRequired"] = {"KHR_unheard_of"}; }, "glb-json",
                    "/extensionsRequired"));
  EXPECT_TRUE(finds([](json& j) { j["extensionsRequired"] = {"KHR_mesh_quantization"}; }, "glb-json",
                    "/extensionsUsed"));
  EXPECT_TRUE(finds([](json& j) { j["accessors"][0]["count"] = -5; }, "glb-json", "/accessors/0/count"));
  EXPECT_TRUE(finds([](json& j) { j["meshes"] = 5; }, "glb-json", "/meshes"));
  GlbParts deep = good();
  json nested = 1;
  for (int k = 0; k < 100; ++k) nested = json::array({nested});
  deep.json["extras"] = nested;
  EXPECT_TRUE(finds(deep.glb(), "glb-json", ""));
}

TEST(CheckGlb, References) {
  EXPECT_TRUE(finds([](json& j) { j["meshes"][0]["primitives"][0]["material"] = 3; }, "glb-reference",
                    "/meshes/0/primitives/0/material"));
  EXPECT_TRUE(finds([](json& j) { j["meshes"][0]["primitives"][0].erase("attributes"); }, "glb-reference",
                    "/meshes/0/primitives/0/attributes/POSITION"));
  EXPECT_TRUE(
      finds([](json& j) { j["materials"][0]["pbrMetallicRoughness"]["baseColorTexture"]["index"] = 1; },
            "glb-reference", "/materials/0/pbrMetallicRoughness/baseColorTexture/index"));
  EXPECT_TRUE(finds([](json& j) { j["textures"][0]["source"] = 9; }, "glb-reference", "/textures/0/source"));
  EXPECT_TRUE(finds([](json& j) { j["nodes"][0]["mesh"] = 1; }, "glb-reference", "/nodes/0/mesh"));
  EXPECT_TRUE(
      finds([](json& j) { j["buffers"][0]["uri"] = "../secret"; }, "glb-reference", "/buffers/0/uri"));
  EXPECT_TRUE(finds([](json& j) { j["scene"] = 1; }, "glb-reference", "/scene"));
}

TEST(CheckGlb, Accessors) {
  EXPECT_TRUE(finds([](json& j) { j["accessors"][1]["count"] = 3; }, "glb-accessor",
                    "/meshes/0/primitives/0/attributes/TEXCOORD_0"));
  EXPECT_TRUE(
      finds([](json& j) { j["accessors"][0]["count"] = 1ull << 31; }, "glb-accessor", "/accessors/0"));
  EXPECT_TRUE(finds([](json& j) { j["accessors"][0]["byteOffset"] = 2; }, "glb-accessor", "/accessors/0"));
  EXPECT_TRUE(finds([](json& j) { j["accessors"][0]["componentType"] = 5130; }, "glb-accessor",
                    "/accessors/0/componentType"));
  EXPECT_TRUE(finds([](json& j) { j["accessors"][2]["count"] = 35; }, "glb-accessor",
                    "/meshes/0/primitives/0/indices"));
  EXPECT_TRUE(finds([](json& j) { j["accessors"][0].erase("max"); }, "glb-accessor",
                    "/meshes/0/primitives/0/attributes/POSITION/max"));
  EXPECT_TRUE(finds([](json& j) { j["accessors"][0]["max"][1] = 1.5; }, "glb-position",
                    "/meshes/0/primitives/0/attributes/POSITION/max"));
}

TEST(CheckGlb, IndicesAndPositions) {
  GlbParts g = good();
  const std::size_t indices = g.json["bufferViews"][2]["byteOffset"];
  g.binary[indices + 1] = 9;
  EXPECT_TRUE(finds(g.glb(), "glb-index", "/meshes/0/primitives/0/indices"));
  g = good();
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::memcpy(g.binary.data() + 24, &nan, 4);
  EXPECT_TRUE(finds(g.glb(), "glb-position", "/meshes/0/primitives/0/attributes/POSITION"));
}

TEST(CheckGlb, Nodes) {
  EXPECT_TRUE(finds([](json& j) { j["nodes"][0]["children"] = {0}; }, "glb-node", "/nodes/0"));
  EXPECT_TRUE(finds(
      [](json& j) {
        j["nodes"] = {{{"mesh", 0}}, {{"children", {2}}}, {{"children", {1}}}};
      },
      "glb-node", "/nodes/1"));
  EXPECT_TRUE(finds(
      [](json& j) {
        j["nodes"] = {{{"mesh", 0}, {"children", {1}}}, json::object()};
        j["scenes"][0]["nodes"] = {1};
      },
      "glb-node", "/scenes/0/nodes"));
  EXPECT_TRUE(finds([](json& j) { j["nodes"][0]["scale"] = {1, 2}; }, "glb-node", "/nodes/0/scale"));
}

TEST(CheckGlb, ImagesOfAPackageMayBePreviewsByTheirPlace) {
  const auto with_uri = [](const json& uri) {
    GlbParts g = good();
    json& image = g.json["images"][0];
    image.erase("bufferView");
    image["uri"] = uri;
    return g;
  };
  const Checked c = check(with_uri("../preview/012.jpg").glb());
  EXPECT_EQ(c.facts.image_uris, std::vector<std::string>{"../preview/012.jpg"});
  EXPECT_TRUE(c.findings.empty());
  for (const json& uri : std::vector<json>{"../preview/12.jpg", "preview/012.jpg", "../poster.jpg",
                                           "../../preview/012.jpg", "http://host/preview/012.jpg", 7})
    EXPECT_TRUE(finds(with_uri(uri).glb(), "glb-image", "/images/0/uri")) << uri;
}

TEST(CheckGlb, Images) {
  EXPECT_TRUE(
      finds([](json& j) { j["images"][0]["mimeType"] = "image/png"; }, "glb-image", "/images/0/mimeType"));
  GlbParts g = good();
  g.binary.back() ^= 0xff;  // the end of the JPEG or its padding
  const std::size_t end = g.json["bufferViews"][3]["byteOffset"].get<std::size_t>() +
                          g.json["bufferViews"][3]["byteLength"].get<std::size_t>();
  g.binary[end - 1] = 0;
  EXPECT_TRUE(finds(g.glb(), "glb-image", "/images/0"));
}

TEST(CheckGlb, Draco) {
  const Checked c = check(draco_cube().glb());
  EXPECT_EQ(c.text, "");
  EXPECT_EQ(c.facts.codec, "draco");
  EXPECT_EQ(c.facts.triangles, 12u);
  EXPECT_EQ(c.facts.bounds_min, (Vec3d{-1, -1, -1}));
  const std::string at = "/meshes/0/primitives/0";
  GlbParts g = draco_cube();
  g.json["accessors"][2]["count"] = 33;
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at + "/indices"));
  g = draco_cube();
  g.json["accessors"][0]["count"] = g.json["accessors"][1]["count"] = 7;
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at + "/attributes/POSITION"));
  g = draco_cube();
  g.json["meshes"][0]["primitives"][0]["extensions"]["KHR_draco_mesh_compression"]["attributes"]["POSITION"] =
      40;
  EXPECT_TRUE(
      finds(g.glb(), "glb-decode", at + "/extensions/KHR_draco_mesh_compression/attributes/POSITION"));
  g = draco_cube();
  g.binary[0] = 'X';
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at + "/extensions/KHR_draco_mesh_compression"));
}

TEST(CheckGlb, Meshopt) {
  const Checked c = check(meshopt_cube().glb());
  EXPECT_EQ(c.text, "");
  EXPECT_EQ(c.facts.codec, "meshopt");
  EXPECT_EQ(c.facts.triangles, 12u);
  EXPECT_EQ(c.facts.bounds_max, (Vec3d{1, 1, 1}));
  const std::string at = "/bufferViews/0/extensions/EXT_meshopt_compression";
  GlbParts g = meshopt_cube();
  g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["count"] = 5000;
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at));
  g = meshopt_cube();
  g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteLength"] = 1 << 20;
  EXPECT_TRUE(finds(g.glb(), "glb-reference", at));
  g = meshopt_cube();
  g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["filter"] = "QUATERNION";
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at));
  // What KHR_meshopt_compression alone has.
  g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["filter"] = "COLOR";
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at + "/filter"));
  g = meshopt_cube();
  g.binary[g.json["bufferViews"][0]["extensions"]["EXT_meshopt_compression"]["byteOffset"]
               .get<std::size_t>()] = 0xa1;
  EXPECT_TRUE(finds(g.glb(), "glb-decode", at));
}

TEST(CheckGlb, MeshoptViewsHoldAtMost4GiBTogether) {
  GlbParts g = meshopt_cube();
  const auto says = [&](std::size_t view, std::uint64_t bytes) {
    json& stream = g.json["bufferViews"][view]["extensions"]["EXT_meshopt_compression"];
    stream["count"] = bytes / stream["byteStride"].get<std::uint64_t>();
    return check(g.glb()).text.find("at most 4 GiB in all views") != std::string::npos;
  };
  EXPECT_FALSE(says(0, 3ull << 30)) << "it alone is refused by what its data can hold";
  EXPECT_FALSE(says(2, 1ull << 29));
  EXPECT_TRUE(says(2, 3ull << 29));
  g = meshopt_cube();
  EXPECT_TRUE(says(0, 5ull << 30));
}

}  // namespace texmesh::check_glb_test
