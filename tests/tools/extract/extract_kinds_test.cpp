// extract --bytes on models of every kind of textures: all maps that show count, and all bytes are used.
#include <gtest/gtest.h>

#include <cmath>
#include <sstream>

#include "pipeline/compile/compile_model.h"
#include "stages/gltf/check_glb.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tests/support/meshes.h"
#include "tools/extract/budget/filling.h"
#include "tools/extract/extract.h"

namespace texmesh::extract_kinds_test {

using Json = nlohmann::json;
using testing::GltfBuilder;

constexpr int kCells = 20, kTexels = 64;

/// What a model is made of.
struct Kind {
  const char* name;
  bool base = false, normal = false, data = false, alpha = false, colours = false;
  int materials = 1;
};
constexpr Kind kKinds[] = {
    {.name = "normal only", .normal = true},
    {.name = "normal and roughness", .normal = true, .data = true},
    {.name = "data only", .data = true},
    {.name = "vertex colours", .colours = true},
    {.name = "untextured"},
    {.name = "several materials", .base = true, .normal = true, .materials = 2},
    {.name = "alpha", .base = true, .alpha = true},
};

/// Texels of a map, different for every `seed`. Normals are unit vectors around +Z.
std::vector<std::uint8_t> texels(int channels, bool normals, int seed) {
  std::vector<std::uint8_t> out;
  for (int y = 0; y < kTexels; ++y)
    for (int x = 0; x < kTexels; ++x) {
      const double a = std::sin(0.35 * x + seed) + 0.5 * std::sin(0.9 * y), b = std::cos(0.3 * y - 0.2 * x);
      const double nx = 0.35 * a, ny = 0.35 * b, nz = std::sqrt(1 / (1 + nx * nx + ny * ny));
      const double value[4] = {normals ? 0.5 + 0.5 * nx * nz : 0.5 + 0.3 * a,
                               normals ? 0.5 + 0.5 * ny * nz : 0.5 + 0.4 * b,
                               normals ? 0.5 + 0.5 * nz : 0.3 + 0.2 * a * b, 0.5 + 0.45 * b};
      for (int c = 0; c < channels; ++c)
        out.push_back(static_cast<std::uint8_t>(std::clamp(value[c], 0.0, 1.0) * 255));
    }
  return out;
}

int add_texture(GltfBuilder& b, int channels, bool normals, int seed) {
  const Bytes png = testing::encode_image("png", kTexels, kTexels, channels, texels(channels, normals, seed),
                                          OIIO::TypeDesc::UINT8);
  const auto image = b.push("images", {{"bufferView", b.view_of(png)}, {"mimeType", "image/png"}});
  return static_cast<int>(b.push("textures", {{"source", image}}));
}

void add_material(GltfBuilder& b, const Kind& kind, int seed) {
  Json material{{"pbrMetallicRoughness", {{"metallicFactor", kind.data ? 1.0 : 0.0}}}};
  Json& pbr = material["pbrMetallicRoughness"];
  if (kind.base) pbr["baseColorTexture"] = {{"index", add_texture(b, kind.alpha ? 4 : 3, false, seed)}};
  if (kind.data) {
    pbr["metallicRoughnessTexture"] = {{"index", add_texture(b, 3, false, seed + 1)}};
    material["occlusionTexture"] = pbr["metallicRoughnessTexture"];
  }
  if (kind.normal) material["normalTexture"] = {{"index", add_texture(b, 3, true, seed + 2)}};
  if (kind.alpha) material["alphaMode"] = "BLEND";
  material["doubleSided"] = true;
  b.push("materials", material);
}

/// Bumpy sheets, one of every material.
GltfBuilder model_of(const Kind& kind) {
  GltfBuilder b;
  for (int m = 0; m < kind.materials; ++m) {
    std::vector<float> positions, uvs, colours;
    std::vector<std::uint16_t> indices;
    for (int y = 0; y <= kCells; ++y)
      for (int x = 0; x <= kCells; ++x) {
        const double u = static_cast<double>(x) / kCells, v = static_cast<double>(y) / kCells;
        const double h = 0.1 * std::sin(9 * u + m) * std::cos(7 * v) + 0.02 * std::sin(40 * u * v);
        positions.insert(positions.end(),
                         {static_cast<float>(u + 1.1 * m), static_cast<float>(v), static_cast<float>(h)});
        uvs.insert(uvs.end(), {static_cast<float>(u), static_cast<float>(v)});
        colours.insert(colours.end(), {static_cast<float>(u), static_cast<float>(0.5 + 0.4 * std::sin(9 * v)),
                                       static_cast<float>(1 - v)});
      }
    for (int y = 0; y < kCells; ++y)
      for (int x = 0; x < kCells; ++x) {
        const int a = y * (kCells + 1) + x, c = a + kCells + 1;
        for (int i : {a, a + 1, c + 1, a, c + 1, c}) indices.push_back(static_cast<std::uint16_t>(i));
      }
    Json attributes{{"POSITION", b.attribute(positions, "VEC3", {{"min", {0, 0, -1}}, {"max", {3, 1, 1}}})},
                    {"TEXCOORD_0", b.attribute(uvs, "VEC2")}};
    if (kind.colours) attributes["COLOR_0"] = b.attribute(colours, "VEC3");
    add_material(b, kind, 3 * m);
    b.mesh(attributes, {{"indices", b.attribute(indices, "SCALAR")}, {"material", m}});
    b.node({{"mesh", m}});
  }
  return b;
}

class ExtractKinds : public ::testing::TestWithParam<Kind> {
 protected:
  void SetUp() override {
    const Bytes glb = model_of(GetParam()).glb();
    testing::write_text(folder_ / "a.glb", {glb.begin(), glb.end()});
    CompileRequest request;
    request.input = folder_ / "a.glb";
    request.output = folder_ / "a.texmesh";
    request.options.quality = {1, 32, 1};
    NullStore store;
    compile_model(request, store, {}, {});
  }
  Extracted extract(std::uint64_t bytes, int threads = 2, ExtractEffort effort = ExtractEffort::kUsual) {
    PackageReader package(open_store(folder_ / "a.texmesh"));
    ExtractBudget budget;
    budget.bytes = {bytes};
    budget.display_px = 64;  // small pictures, quick tests
    budget.effort = effort;
    RunContext context;
    context.threads = threads;
    const Extracted e = extract_model(package, {budget}, context);
    Findings findings;
    check_glb(e.glb, "x.glb", findings, GlbRules::kStandalone);
    for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
    return e;
  }
  testing::TemporaryFolder folder_;
};

TEST_P(ExtractKinds, AnyNumberOfBytesIsReachedAndDifferencesAreSeen) {
  const Extracted least = extract(1), most = extract(100'000'000);
  EXPECT_FALSE(least.within);
  EXPECT_TRUE(most.within);
  ASSERT_LT(least.glb.size(), most.glb.size());
  EXPECT_LT(most.difference, least.difference);
  const double ratio = static_cast<double>(most.glb.size()) / static_cast<double>(least.glb.size());
  for (const double part : {0.05, 0.4, 0.7, 0.97}) {
    const auto bytes =
        static_cast<std::uint64_t>(static_cast<double>(least.glb.size()) * std::pow(ratio, part));
    const Extracted e = extract(bytes);
    EXPECT_TRUE(e.within) << GetParam().name << ", of " << bytes << ": " << e.glb.size() << ", S_" << e.scale;
    EXPECT_LE(e.glb.size(), bytes);
    if (part < 0.9) EXPECT_GT(e.difference, 0) << GetParam().name << " " << bytes;
    EXPECT_LE(e.difference, least.difference + 0.01);
  }
  const std::uint64_t bytes = least.glb.size() * 5 / 4;
  EXPECT_EQ(extract(bytes, 1).glb, extract(bytes, 8).glb);
}

TEST_P(ExtractKinds, TablesAloneGiveAFileThatFits) {
  const std::uint64_t least = extract(1).glb.size();
  double before = 1;
  for (const std::uint64_t bytes : {2 * least, 8 * least, std::uint64_t{100'000'000}}) {
    const Extracted fast = extract(bytes, 1, ExtractEffort::kFast);
    EXPECT_LE(fast.glb.size(), bytes) << GetParam().name;
    EXPECT_EQ(fast.views, 0) << "no picture was taken";
    EXPECT_LE(fast.difference, before) << GetParam().name << " " << bytes;
    before = fast.difference;
    EXPECT_EQ(fast.glb, extract(bytes, 8, ExtractEffort::kFast).glb);
  }
}

INSTANTIATE_TEST_SUITE_P(Kinds, ExtractKinds, ::testing::ValuesIn(kKinds), [](const auto& kind) {
  std::string name = kind.param.name;
  std::replace(name.begin(), name.end(), ' ', '_');
  return name;
});

TEST(ExtractMesh, ALittleLeanerThanStoredItKeepsItsNormals) {
  const testing::TemporaryFolder folder;
  const Mesh mesh = testing::bumpy_sphere(30, 60);
  std::ostringstream obj;
  for (const Vec3f& p : mesh.positions) obj << "v " << p.x << ' ' << p.y << ' ' << p.z << '\n';
  for (const Vec3f& n : mesh.normals) obj << "vn " << n.x << ' ' << n.y << ' ' << n.z << '\n';
  for (const Triangle& t : mesh.triangles) {
    obj << 'f';
    for (const std::uint32_t w : t) obj << ' ' << mesh.wedge_position[w] + 1 << "//" << w + 1;
    obj << '\n';
  }
  testing::write_text(folder / "a.obj", obj.str());
  CompileRequest request;
  request.input = folder / "a.obj";
  request.output = folder / "a.texmesh";
  request.options.quality = {1, 32, 1};
  NullStore store;
  compile_model(request, store, {}, {});
  PackageReader package(open_store(folder / "a.texmesh"));
  TextureSource textures(package, 1e7, {});
  const Reference reference(package, {}, {}, textures, {});
  Candidates candidates(reference, textures);
  const Filling filling(reference, candidates, 100'000);
  const MeshCandidate &stored = candidates.mesh({0, kMeshCodings - 1, 0}),
                      &leaner = candidates.mesh({0, kMeshCodings - 1, -1}),
                      &next = candidates.mesh({0, kMeshCodings - 2, 0});
  EXPECT_EQ(stored.geometry, 0);
  EXPECT_LT(filling.mesh_file(leaner).fixed_bytes, filling.mesh_file(stored).fixed_bytes);
  EXPECT_LT(leaner.geometry, 0.5 * next.geometry);
}

}  // namespace texmesh::extract_kinds_test
