// From a model's bytes through a package to the GLB that extract writes: what of the source comes back.
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "format/base/vec.h"
#include "pipeline/compile/compile_model.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tools/extract/extract.h"

namespace texmesh::extract_source_test {

using Json = nlohmann::json;
using testing::GltfBuilder;

constexpr int kSide = 8;

/// A bumpy sheet of 0.1 object units a cell with a texture, which a node puts at `place`.
GltfBuilder sheet(Vec3d place, const Bytes& picture, const std::string& media_type) {
  GltfBuilder b;
  std::vector<float> positions, uvs;
  std::vector<std::uint16_t> indices;
  for (int y = 0; y <= kSide; ++y)
    for (int x = 0; x <= kSide; ++x) {
      positions.insert(positions.end(), {0.1f * static_cast<float>(x), 0.1f * static_cast<float>(y),
                                         0.03f * static_cast<float>((x * 7 + y * 5) % 4)});
      uvs.insert(uvs.end(), {static_cast<float>(x) / kSide, static_cast<float>(y) / kSide});
    }
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const int a = y * (kSide + 1) + x, c = a + kSide + 1;
      for (int i : {a, a + 1, c + 1, a, c + 1, c}) indices.push_back(static_cast<std::uint16_t>(i));
    }
  b.mesh({{"POSITION", b.attribute(positions, "VEC3", {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}})},
          {"TEXCOORD_0", b.attribute(uvs, "VEC2")}},
         {{"indices", b.attribute(indices, "SCALAR")}, {"material", 0}});
  b.node({{"mesh", 0}, {"name", "sheet"}, {"translation", {place.x, place.y, place.z}}});
  b.push("images", {{"bufferView", b.view_of(picture)}, {"mimeType", media_type}});
  b.push("textures", {{"source", 0}});
  b.push("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  return b;
}
Bytes picture_file(const char* format) {
  return testing::encode_image(format, 64, 64, 3, testing::test_picture(64, 64, 3), OIIO::TypeDesc::UINT8);
}
GltfBuilder sheet(Vec3d place) { return sheet(place, picture_file("png"), "image/png"); }

class SourceToExtract : public ::testing::Test {
 protected:
  std::string compile(const GltfBuilder& source, MeshCodec codec) {
    const Bytes glb = source.glb();
    testing::write_text(folder_ / "a.glb", {glb.begin(), glb.end()});
    CompileRequest request;
    request.input = folder_ / "a.glb";
    request.output = folder_ / "a.texmesh";
    request.options.scales.mesh_codec = codec;
    NullStore store;
    compile_model(request, store, {}, {});
    return request.output;
  }
  static Bytes extract(const std::string& package, const ExtractRequest& request) {
    PackageReader reader(open_store(package));
    const Bytes glb = extract_model(reader, request, {}).glb;
    Findings findings;
    check_glb(glb, "x.glb", findings, GlbRules::kStandalone);
    for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
    return glb;
  }
  static Model import(const Bytes& glb) {
    testing::MemoryResolver nothing;
    return import_model("x.glb", glb, nothing, {}, {}).model;
  }
  testing::TemporaryFolder folder_;
};

/// How far from the sheet's vertices the farthest vertex of a mesh is, and its box in the source's
/// coordinates.
double farthest_from_sheet(const Mesh& mesh, Vec3d place, Box3d& box) {
  double worst = 0;
  for (const Vec3f& local : mesh.positions) {
    const Vec3d p = to_double(local) + mesh.origin;
    box.extend(p);
    const Vec3d at = p - place;
    const double x = std::floor(at.x / 0.1 + 0.5), y = std::floor(at.y / 0.1 + 0.5);
    const double z = 0.03 * (static_cast<int>(x * 7 + y * 5) % 4);
    worst = std::max({worst, std::fabs(at.x - 0.1 * x), std::fabs(at.y - 0.1 * y), std::fabs(at.z - z)});
  }
  return worst;
}

std::vector<std::pair<std::string, ExtractRequest>> every_kind_of_request() {
  ExtractScale whole, lods;
  whole.scale = 0;
  lods.scale = 0, lods.form = ExtractScale::Form::kLevels;
  ExtractBudget bytes;
  bytes.scale = 0, bytes.bytes = {20000}, bytes.display_px = 64;
  ExtractBudget bytes_lods = bytes;
  bytes_lods.levels = true;
  return {{"whole", {whole}}, {"lods", {lods}}, {"bytes", {bytes}}, {"bytes and lods", {bytes_lods}}};
}

TEST_F(SourceToExtract, TheModelStandsWhereTheSourceHasIt) {
  const Vec3d place{-0.7, 1.0e6 + 0.123, 16.9};
  for (const MeshCodec codec : {MeshCodec::kDraco, MeshCodec::kNone}) {
    const std::string package = compile(sheet(place), codec);
    for (const auto& [what, request] : every_kind_of_request()) {
      SCOPED_TRACE(what);
      const Mesh mesh = import(extract(package, request)).mesh;
      EXPECT_EQ(mesh.triangles.size(), std::size_t{2 * kSide * kSide});
      EXPECT_EQ(mesh.part_names, std::vector<std::string>{"sheet"});
      Box3d box;
      // Draco's grid has 10 bits and more along the longest side.
      EXPECT_LT(farthest_from_sheet(mesh, place, box), codec == MeshCodec::kNone ? 1e-6 : 0.001);
      for (int i = 0; i < 3; ++i) EXPECT_NEAR(box.min[i], place[i], 0.001) << i;
    }
  }
}

TEST_F(SourceToExtract, RecentreLeavesTheModelInThePackagesFrame) {
  const Vec3d place{0, 0, 16.9};
  const std::string package = compile(sheet(place), MeshCodec::kNone);
  const Vec3d origin = PackageReader(open_store(package)).manifest().origin;
  ASSERT_NEAR(origin.z, 16.9, 0.1);
  for (auto [what, request] : every_kind_of_request()) {
    SCOPED_TRACE(what);
    request.recentre = true;
    Box3d box;
    EXPECT_LT(farthest_from_sheet(import(extract(package, request)).mesh, place - origin, box), 1e-6);
    EXPECT_LT(std::fabs(box.min.z), 0.1);
  }
}

TEST_F(SourceToExtract, AModelNearZeroNeedsNoFurtherNode) {
  const std::string package = compile(sheet({}), MeshCodec::kNone);
  ExtractRequest request;
  const Bytes placed = extract(package, request);
  request.recentre = true;
  EXPECT_EQ(placed, extract(package, request));
}

Json samplers_of(const Bytes& glb) {
  std::uint32_t length = 0;
  std::memcpy(&length, glb.data() + 12, 4);
  return Json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(length))["samplers"];
}

TEST_F(SourceToExtract, SamplersAreTheSources) {
  GltfBuilder b = sheet({});
  b.json["textures"][0]["sampler"] = 0;
  for (const int min_filter : {9728, 9729, 9984, 9985, 9986, 9987}) {
    const int mag_filter = min_filter % 2 == 0 ? 9729 : 9728;
    b.json["samplers"] = Json::array(
        {{{"minFilter", min_filter}, {"magFilter", mag_filter}, {"wrapS", 33071}, {"wrapT", 33648}}});
    const std::string package = compile(b, MeshCodec::kNone);
    EXPECT_EQ(samplers_of(PackageReader(open_store(package)).scale_glb(0)), b.json["samplers"]);
    for (const auto& [what, request] : every_kind_of_request())
      EXPECT_EQ(samplers_of(extract(package, request)), b.json["samplers"]) << what;
  }
}

TEST_F(SourceToExtract, WithBytesEnoughTheMapsAreTheSourcesOwn) {
  const Bytes source = picture_file("jpg");
  const Pixels expected = decode_image(probe_image("source", source, {}));
  const std::string package = compile(sheet({}, source, "image/jpeg"), MeshCodec::kDraco);
  ExtractBudget bytes;
  bytes.bytes = {10'000'000}, bytes.display_px = 64;
  for (const ExtractRequest& request : {ExtractRequest{}, ExtractRequest{bytes}}) {
    PackageReader reader(open_store(package));
    const Extracted e = extract_model(reader, request, {});
    EXPECT_TRUE(e.within);
    ASSERT_EQ(e.images.size(), 1u);
    const Pixels found = decode_image(import(e.glb).images.at(0));
    EXPECT_EQ(found.data, expected.data);
  }
}

}  // namespace texmesh::extract_source_test
