// From a model's bytes through the whole graph to what a client of the package reads: materials and their
// textures, and where the mesh stands.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package/package_reader.h"
#include "format/model/material_extensions.h"
#include "pipeline/compile/compile_model.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tools/extract/glb/standalone_glb.h"

namespace texmesh::compile_model_scales_test {

using Json = nlohmann::json;

using testing::GltfBuilder;

struct Package {
  std::unique_ptr<PackageReader> reader;
  Notes notes;
  Json glb_json(int scale = 0) {
    const Bytes glb = scale_file(*reader, scale, {}).finish();
    std::uint32_t length = 0;
    std::memcpy(&length, glb.data() + 12, 4);
    return Json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(length));
  }
  ImportedModel import_scale(int scale = 0) {
    testing::MemoryResolver nothing;
    return import_model("scale.glb", scale_file(*reader, scale, {}).finish(), nothing, {}, {});
  }
};

class SourceToScales : public ::testing::Test {
 protected:
  Package compile(const std::string& name, const Bytes& bytes, const CompileOptions& options = {}) {
    testing::write_text(folder_ / name, {bytes.begin(), bytes.end()});
    CompileRequest request;
    request.input = folder_ / name;
    request.output = folder_ / (name + ".texmesh");
    request.options = options;
    NullStore store;
    Package package;
    package.notes = compile_model(request, store, {}, {}).notes;
    package.reader = std::make_unique<PackageReader>(open_store(request.output));
    return package;
  }
  testing::TemporaryFolder folder_;
};

/// A bumpy n x n sheet with UVs in 0..1.
GltfBuilder sheet(int n) {
  GltfBuilder b;
  std::vector<float> positions, uvs;
  std::vector<std::uint16_t> indices;
  for (int y = 0; y <= n; ++y)
    for (int x = 0; x <= n; ++x) {
      positions.insert(positions.end(), {static_cast<float>(x), static_cast<float>(y),
                                         0.25f * static_cast<float>((x * 7 + y * 5) % 4)});
      uvs.insert(uvs.end(), {static_cast<float>(x) / static_cast<float>(n),
                             static_cast<float>(y) / static_cast<float>(n)});
    }
  for (int y = 0; y < n; ++y)
    for (int x = 0; x < n; ++x) {
      const int a = y * (n + 1) + x, c = a + n + 1;
      for (int i : {a, a + 1, c + 1, a, c + 1, c}) indices.push_back(static_cast<std::uint16_t>(i));
    }
  const Json bounds = {{"min", {0, 0, 0}}, {"max", {n, n, 1}}};
  b.mesh({{"POSITION", b.attribute(positions, "VEC3", bounds)}, {"TEXCOORD_0", b.attribute(uvs, "VEC2")}},
         {{"indices", b.attribute(indices, "SCALAR")}});
  b.node({{"mesh", 0}, {"name", "sheet"}});
  return b;
}

/// A texture of its own: a picture with `seed` in one corner.
int texture(GltfBuilder& b, int width, int height, int channels, int seed) {
  std::vector<std::uint8_t> samples = testing::test_picture(width, height, channels);
  samples[0] = static_cast<std::uint8_t>(seed);
  samples[1] = static_cast<std::uint8_t>(seed / 256);
  const Bytes file = testing::encode_image("png", width, height, channels, samples, OIIO::TypeDesc::UINT8);
  return b.push("textures",
                {{"source", b.push("images", {{"bufferView", b.view_of(file)}, {"mimeType", "image/png"}})}});
}

TEST_F(SourceToScales, EveryTextureOfAMaterialArrives) {
  GltfBuilder b = sheet(12);
  int seed = 0;
  const auto info = [&](int channels) {
    ++seed;
    return Json{{"index", texture(b, 40 + 8 * (seed % 5), 56 - 8 * (seed % 3), channels, seed)}};
  };
  Json material;
  material["pbrMetallicRoughness"] = {{"baseColorTexture", info(4)}, {"metallicRoughnessTexture", info(3)}};
  material["alphaMode"] = "BLEND";
  material["normalTexture"] = info(3);
  material["occlusionTexture"] = info(1);  // grey, and another image than the roughness
  material["emissiveTexture"] = info(3);
  material["emissiveFactor"] = {1, 1, 1};
  std::size_t textures = 5, alphas = 1;
  for (const MaterialExtensionKind& kind : material_extensions()) {
    if (kind.converted) continue;  // would replace the base colour
    Json& e = material["extensions"][std::string(kind.name)] = Json::object();
    for (const ExtensionTextureKind& t : kind.textures) {
      e[std::string(t.key)] = info(t.channels == TextureChannels::kColour ? 3 : 4);
      ++textures;
      alphas += t.channels != TextureChannels::kColour;
    }
  }
  b.push("materials", material);
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  Package package = compile("m.glb", b.glb());
  for (const Note& n : package.notes) EXPECT_NE(n.severity, Severity::kWarning) << n.text;

  std::size_t planes[2] = {0, 0};
  for (const TextureInfo& t : package.reader->textures()) {
    if (t.preview.path.empty()) continue;
    ++planes[t.role == "alpha"];
    const bool colour = t.role == "base-colour" || t.role == "emissive" || t.role == "colour";
    EXPECT_EQ(t.colour_space, colour ? "srgb" : "linear") << t.role;
  }
  EXPECT_EQ(planes[0], textures);
  EXPECT_EQ(planes[1], alphas);

  const int coarsest = package.reader->manifest().scales.back().scale;
  for (const int scale : {0, coarsest}) {
    const ImportedModel back = package.import_scale(scale);
    EXPECT_EQ(back.model.images.size(), textures) << scale;
    EXPECT_EQ(back.model.mesh.part_names, (std::vector<std::string>{"sheet"}));
    std::size_t used = 0;
    for_each_texture(back.model.materials.at(0), [&](const TextureRef& t) { used += t.used(); });
    EXPECT_EQ(used, textures);
  }
}

TEST_F(SourceToScales, TwoHundredAndTwentySmallTextures) {
  constexpr int kCount = 220;
  GltfBuilder b = sheet(2);
  const Json primitive = b.json["meshes"][0]["primitives"][0];
  b.json["meshes"] = Json::array();
  b.json["nodes"] = Json::array();
  for (int k = 0; k < kCount; ++k) {
    b.push("materials", {{"name", "m" + std::to_string(k)},
                         {"pbrMetallicRoughness",
                          {{"baseColorTexture", {{"index", texture(b, 16 + k % 9, 16 + k % 7, 3, k)}}}}}});
    Json p = primitive;
    p["material"] = k;
    b.push("meshes", {{"primitives", {p}}});
    b.node({{"mesh", k}, {"name", "tile " + std::to_string(k)}, {"translation", {3 * k, 0, 0}}});
  }
  Package package = compile("many.glb", b.glb());
  const ImportedModel back = package.import_scale();
  EXPECT_EQ(package.glb_json()["images"].size(), std::size_t{kCount});
  EXPECT_EQ(back.model.mesh.part_names.size(), std::size_t{kCount});
  EXPECT_EQ(back.model.materials.at(219).name, "m219");
  std::size_t full = 0;
  for (const TextureInfo& t : package.reader->textures())
    full += t.role == "base-colour" && t.width_px == 16 + t.image % 9;
  EXPECT_EQ(full, std::size_t{kCount});
}

TEST_F(SourceToScales, NoTexturesNoTextureEntries) {
  const std::string ply =
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "property uchar red\nproperty uchar green\nproperty uchar blue\nelement face 4\n"
      "property list uchar int vertex_indices\nend_header\n"
      "0 0 0 255 0 0\n1 0 0 0 255 0\n0 1 0 0 0 255\n0 0 1 255 255 255\n"
      "3 0 2 1\n3 0 1 3\n3 1 2 3\n3 0 3 2\n";
  GltfBuilder plain = sheet(4);
  for (const auto& [name, bytes] : {std::pair<std::string, Bytes>{"colours.ply", {ply.begin(), ply.end()}},
                                    std::pair<std::string, Bytes>{"plain.glb", plain.glb()}}) {
    Package package = compile(name, bytes);
    EXPECT_TRUE(package.reader->textures().empty()) << name;
    for (const EntryRef& e : package.reader->index()) {
      EXPECT_NE(e.path.rfind("texture/", 0), 0u) << e.path;
      EXPECT_NE(e.path.rfind("preview/", 0), 0u) << e.path;
    }
    const Json json = package.glb_json();
    EXPECT_FALSE(json.contains("images") || json.contains("textures"));
    EXPECT_EQ(json["meshes"][0]["primitives"][0]["attributes"].contains("COLOR_0"), name == "colours.ply");
  }
}

/// Height of the georeferenced relief: millimetres on a field of a few metres.
double relief(int x, int y) { return 0.001 * ((x * 7 + y * 5) % 11); }

TEST_F(SourceToScales, MillimetresTenThousandKilometresAway) {
  constexpr int kSide = 12;
  constexpr double kEast = 1.0e7, kNorth = 2.5e7, kStep = 0.05;
  std::string obj;
  for (int y = 0; y <= kSide; ++y)
    for (int x = 0; x <= kSide; ++x) {
      char line[100];
      std::snprintf(line, sizeof line, "v %.4f %.4f %.4f\n", kEast + kStep * x, relief(x, y),
                    kNorth + kStep * y);
      obj += line;
    }
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const int a = y * (kSide + 1) + x + 1, b = a + kSide + 1;
      obj += "f " + std::to_string(a) + " " + std::to_string(b) + " " + std::to_string(b + 1) + "\n";
      obj += "f " + std::to_string(a) + " " + std::to_string(b + 1) + " " + std::to_string(a + 1) + "\n";
    }
  // The same as a glTF that a node puts there.
  GltfBuilder b = sheet(kSide);
  b.json["nodes"][0]["translation"] = {kEast, 0, kNorth};
  b.json["nodes"][0]["scale"] = {kStep, kStep, kStep};

  for (MeshCodec codec : {MeshCodec::kDraco, MeshCodec::kNone}) {
    CompileOptions options;
    options.scales.mesh_codec = codec;
    Package far = compile("far.obj", {obj.begin(), obj.end()}, options);
    const Vec3d origin = far.reader->manifest().origin;
    EXPECT_NEAR(origin.x, kEast, 10);
    EXPECT_NEAR(origin.z, kNorth, 10);
    const Mesh mesh = far.import_scale().model.mesh;
    EXPECT_EQ(mesh.triangles.size(), std::size_t{2 * kSide * kSide});
    double worst = 0;
    for (const Vec3f& local : mesh.positions) {
      const Vec3d p = to_double(local) + mesh.origin + origin;
      const int x = static_cast<int>(std::floor((p.x - kEast) / kStep + 0.5));
      const int y = static_cast<int>(std::floor((p.z - kNorth) / kStep + 0.5));
      ASSERT_TRUE(x >= 0 && x <= kSide && y >= 0 && y <= kSide);
      worst = std::max({worst, std::fabs(p.x - kEast - kStep * x), std::fabs(p.z - kNorth - kStep * y),
                        std::fabs(p.y - relief(x, y))});
    }
    // A quarter of a millimetre would be lost ten times over in floats at 1e7, whose step is 1.
    EXPECT_LT(worst, codec == MeshCodec::kNone ? 1e-5 : 0.05 / 16);
    const int coarsest = far.reader->manifest().scales.back().scale;
    EXPECT_GT(far.import_scale(coarsest).model.mesh.triangles.size(), 0u);

    Package placed = compile("placed.glb", b.glb(), options);
    const Vec3d there = placed.reader->manifest().origin;
    EXPECT_NEAR(there.x, kEast, 10);
    const Mesh same = placed.import_scale().model.mesh;
    double lowest = 1e30;
    for (const Vec3f& local : same.positions) lowest = std::min(lowest, local.x + same.origin.x + there.x);
    EXPECT_NEAR(lowest, kEast, 0.01);
  }
}

TEST_F(SourceToScales, NamesMaterialsNormalsAndColoursSurviveToEveryScale) {
  constexpr int kSide = 16, kPoints = (kSide + 1) * (kSide + 1);
  GltfBuilder b = sheet(kSide);
  std::vector<float> normals, colours;
  for (int i = 0; i < kPoints; ++i) {
    normals.insert(normals.end(), {0.6f, 0, 0.8f});
    colours.insert(colours.end(), {0.25f, 0.5f, i < kPoints / 2 ? 0.75f : 1.0f});
  }
  Json& attributes = b.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = b.attribute(normals, "VEC3");
  attributes["COLOR_0"] = b.attribute(colours, "VEC3");
  b.push("materials", {{"name", "stone"}});
  b.push("materials", {{"name", "brick \u00e4"}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const Json mesh_json = b.json["meshes"][0];
  b.push("meshes", mesh_json);
  b.json["meshes"][1]["primitives"][0]["material"] = 1;
  b.json["nodes"][0]["name"] = "left \"wing\"";
  b.node({{"mesh", 1}, {"name", "right"}, {"translation", {30, 0, 0}}});
  for (MeshCodec codec : {MeshCodec::kDraco, MeshCodec::kMeshopt, MeshCodec::kQuantized, MeshCodec::kNone}) {
    CompileOptions options;
    options.scales.mesh_codec = codec;
    Package package = compile("m.glb", b.glb(), options);
    ASSERT_GT(package.reader->manifest().scales.size(), 2u);
    for (const auto& scale : package.reader->manifest().scales) {
      const Json json = package.glb_json(scale.scale);
      ASSERT_EQ(json["nodes"].size(), 2u);
      EXPECT_EQ(json["nodes"][0]["name"], "left \"wing\"");
      EXPECT_EQ(json["nodes"][1]["name"], "right");
      ASSERT_EQ(json["materials"].size(), 2u);
      EXPECT_EQ(json["materials"][1]["name"], "brick \u00e4");
      const Mesh mesh = package.import_scale(scale.scale).model.mesh;
      ASSERT_EQ(mesh.normals.size(), mesh.wedge_count());
      ASSERT_EQ(mesh.colours.size(), mesh.wedge_count());
      for (const Vec3f& n : mesh.normals) EXPECT_LT(length(n - Vec3f{0.6f, 0, 0.8f}), 0.03f);
      for (const Vec4f& c : mesh.colours) {
        EXPECT_NEAR(c.x, 0.25, 0.005);
        EXPECT_NEAR(c.y, 0.5, 0.005);
        EXPECT_TRUE(std::fabs(c.z - 0.75f) < 0.005f || c.z > 0.995f);
      }
    }
  }
}

TEST_F(SourceToScales, TangentsSurviveInEveryFile) {
  constexpr int kSide = 16;
  GltfBuilder b = sheet(kSide);
  Json& attributes = b.json["meshes"][0]["primitives"][0]["attributes"];
  std::vector<float> normals, tangents;
  for (int i = 0; i < (kSide + 1) * (kSide + 1); ++i) {
    normals.insert(normals.end(), {0, 0, 1});
    tangents.insert(tangents.end(), {0.6f, 0.8f, 0, i % 3 ? 1.0f : -1.0f});
  }
  attributes["NORMAL"] = b.attribute(normals, "VEC3");
  attributes["TANGENT"] = b.attribute(tangents, "VEC4");
  b.push("materials", {{"normalTexture", {{"index", texture(b, 64, 64, 3, 1)}}}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  Package package = compile("m.glb", b.glb());
  ASSERT_GT(package.reader->manifest().scales.size(), 1u);
  for (const auto& scale : package.reader->manifest().scales) {
    if (!scale.has_glb()) continue;  // the stream has none
    const Mesh mesh = package.import_scale(scale.scale).model.mesh;
    ASSERT_EQ(mesh.tangents.size(), mesh.wedge_count());
    for (const Vec4f& t : mesh.tangents) {
      EXPECT_NEAR(t.x, 0.6, 0.01);
      EXPECT_NEAR(t.y, 0.8, 0.01);
      EXPECT_TRUE(t.w == 1 || t.w == -1);
    }
  }
}

}  // namespace texmesh::compile_model_scales_test
