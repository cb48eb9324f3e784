// From a model's bytes through the whole graph to what a client of the package reads: materials and their
// textures, and where the mesh stands.
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "delivery/cpp/package_reader.h"
#include "format/material_extensions.h"
#include "pipeline/compile_model.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"

namespace texmesh {
namespace {

using Json = nlohmann::json;
using testing::Bytes;
using testing::GltfBuilder;

struct Package {
  std::unique_ptr<PackageReader> reader;
  Notes notes;
  Json glb_json(int scale = 0) {
    const Bytes glb = reader->scale_glb(scale);
    std::uint32_t length = 0;
    std::memcpy(&length, glb.data() + 12, 4);
    return Json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(length));
  }
  ImportedModel import_scale(int scale = 0) {
    testing::MemoryResolver nothing;
    return import_model("scale.glb", reader->scale_glb(scale), nothing, {}, {});
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
    if (kind.name == "KHR_materials_pbrSpecularGlossiness") continue;  // would replace the base colour
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

}  // namespace
}  // namespace texmesh
