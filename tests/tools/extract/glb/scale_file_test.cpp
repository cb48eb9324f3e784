// Scales as single files: those that packages store, and those of the vertex-split stream alone.
#include "tools/extract/glb/standalone_glb.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "pipeline/compile/compile_model.h"
#include "stages/gltf/check_glb.h"
#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tools/inspect/verify/verify.h"

namespace texmesh::scale_file_test {

constexpr int kSide = 28;

/// A bumpy sheet in two parts with one picture, as a package of several scales. `mapped`: the picture is a
/// normal map, too, and the sheet has tangents.
Bytes compile_sheet(const testing::TemporaryFolder& folder, bool mapped) {
  testing::GltfBuilder b;
  std::vector<float> positions, normals, uvs;
  std::vector<std::uint16_t> halves[2];
  for (int y = 0; y <= kSide; ++y)
    for (int x = 0; x <= kSide; ++x) {
      positions.insert(positions.end(), {static_cast<float>(x), static_cast<float>(y),
                                         0.25f * static_cast<float>((x * 7 + y * 5) % 4)});
      normals.insert(normals.end(), {0, 0, 1});
      uvs.insert(uvs.end(), {static_cast<float>(x) / kSide, static_cast<float>(y) / kSide});
    }
  for (int y = 0; y < kSide; ++y)
    for (int x = 0; x < kSide; ++x) {
      const int a = y * (kSide + 1) + x, c = a + kSide + 1;
      for (int i : {a, a + 1, c + 1, a, c + 1, c})
        halves[x < kSide / 2].push_back(static_cast<std::uint16_t>(i));
    }
  const nlohmann::json bounds = {{"min", {0, 0, 0}}, {"max", {kSide, kSide, 1}}};
  const int at = b.attribute(positions, "VEC3", bounds), n = b.attribute(normals, "VEC3"),
            uv = b.attribute(uvs, "VEC2");
  const Bytes png = testing::png_bytes(64, 64, 3);
  const int image = b.push("images", {{"bufferView", b.view_of(png)}, {"mimeType", "image/png"}});
  b.push("textures", {{"source", image}});
  b.push("materials", {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}});
  nlohmann::json attributes = {{"POSITION", at}, {"NORMAL", n}, {"TEXCOORD_0", uv}};
  if (mapped) {
    std::vector<float> tangents;
    for (std::size_t i = 0; i < uvs.size() / 2; ++i) tangents.insert(tangents.end(), {1, 0, 0, -1});
    attributes["TANGENT"] = b.attribute(tangents, "VEC4");
    b.json["materials"][0]["normalTexture"] = {{"index", 0}};
  }
  for (int half = 0; half < 2; ++half) {
    b.mesh(attributes, {{"indices", b.attribute(halves[half], "SCALAR")}, {"material", 0}});
    b.node({{"mesh", half}, {"name", half == 0 ? "right" : "left"}});
  }
  const Bytes glb = b.glb();
  testing::write_text(folder / "m.glb", {glb.begin(), glb.end()});
  CompileRequest request;
  request.input = folder / "m.glb";
  request.output = folder / "m.texmesh";
  request.options.quality.views = 1, request.options.quality.largest_px = 128;
  request.options.quality.rung_samples = 1;
  NullStore store;
  compile_model(request, store, {}, {});
  const auto source = open_file_source(request.output);
  return source->read(0, source->size());
}

const Bytes& sheet_package() {
  static const testing::TemporaryFolder folder;
  static const Bytes bytes = compile_sheet(folder, false);
  return bytes;
}

PackageReader open(Bytes&& package) = delete;  // the reader keeps no bytes of its own
PackageReader open(const Bytes& package) { return PackageReader(open_container(memory_source(package))); }

std::size_t draco_bytes(const std::vector<DracoStream>& streams) {
  std::size_t bytes = 0;
  for (const DracoStream& s : streams) bytes += s.bytes.size();
  return bytes;
}

TEST(ScaleFile, AHastyOneHoldsTheSameInMoreBytesUntilItIsCodedAgain) {
  PackageReader package = open(sheet_package());
  const std::vector<ManifestScale>& scales = package.manifest().scales;
  const auto streamed = std::ranges::find_if(scales, [](const ManifestScale& s) { return !s.has_glb(); });
  ASSERT_NE(streamed, scales.end());
  const auto file = [&](StreamedNormals normals) {
    return scale_file(package, streamed->scale, {}, normals);
  };
  const StandaloneGlb usual = file(StreamedNormals::kStreamed), hasty = file(StreamedNormals::kHasty);
  EXPECT_GT(draco_bytes(hasty.draco_streams()), draco_bytes(usual.draco_streams()) * 5 / 4);
  const Model a = read_model(usual, "a", {}), b = read_model(hasty, "b", {});
  EXPECT_EQ(a.mesh.triangles.size(), b.mesh.triangles.size());
  EXPECT_EQ(bounding_box(a.mesh.positions).max, bounding_box(b.mesh.positions).max);
  const auto coded = [](const StandaloneGlb& f) {
    return draco_bytes(DracoRecoder(f.draco_streams(), nullptr, "x").coded({0.05, 0.01}, {}));
  };
  EXPECT_NEAR(static_cast<double>(coded(hasty)), static_cast<double>(coded(usual)),
              0.05 * static_cast<double>(coded(usual)));
}

nlohmann::json json_of(const Bytes& glb) {
  const std::size_t bytes = glb[12] | glb[13] << 8 | glb[14] << 16;
  return nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(bytes));
}

GlbFacts facts_of(const Bytes& glb, GlbRules rules) {
  Findings findings;
  GlbFacts facts = check_glb(glb, "x.glb", findings, rules);
  for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
  return facts;
}

TEST(ScaleFile, ThePackageStoresTheEndsAndAStream) {
  const auto store = open_container(memory_source(sheet_package()));
  for (const Finding& f : verify_package(*store, {}).findings) ADD_FAILURE() << to_string(f);
  const PackageReader package = open(sheet_package());
  const Manifest& m = package.manifest();
  ASSERT_GT(m.scales.size(), 2u);
  ASSERT_TRUE(m.stream.has_value());
  for (const ManifestScale& s : m.scales)
    EXPECT_EQ(s.has_glb(), s.scale == 0 || s.scale == m.scales.back().scale) << s.scale;
  EXPECT_LE(start_bytes(m), kStartBytes);
}

TEST(ScaleFile, EveryScaleIsOneFileWithThePreviewsInside) {
  PackageReader package = open(sheet_package());
  const Manifest m = package.manifest();
  const nlohmann::json last = json_of(package.scale_glb(m.scales.back().scale));
  std::vector<Vec3d> finest;
  for (const ManifestScale& s : m.scales)
    for (const StreamedNormals normals : {StreamedNormals::kFitted, StreamedNormals::kStreamed}) {
      SCOPED_TRACE(s.scale);
      const Bytes glb = scale_file(package, s.scale, {}, normals).finish();
      const GlbFacts facts = facts_of(glb, GlbRules::kStandalone);
      EXPECT_EQ(facts.triangles, s.triangles);
      EXPECT_EQ(facts.image_uris, std::vector<std::string>{""});
      EXPECT_EQ(facts.image_digests[0], sha256(package.preview(0)));
      const nlohmann::json json = json_of(glb);
      for (const char* same : {"materials", "textures", "samplers"}) EXPECT_EQ(json[same], last[same]);
      ASSERT_EQ(json["nodes"].size(), 2u);
      EXPECT_EQ(json["nodes"][0]["name"], "right");
      EXPECT_EQ(json["nodes"][1]["name"], "left");
      if (finest.empty()) finest = facts.positions;
      const auto before = [](const Vec3d& p, const Vec3d& q) {
        return std::tie(p.x, p.y, p.z) < std::tie(q.x, q.y, q.z);
      };
      EXPECT_TRUE(std::includes(finest.begin(), finest.end(), facts.positions.begin(), facts.positions.end(),
                                before));
    }
  EXPECT_THROW(scale_file(package, 98, {}), InputError);
}

// The stream has none: they are made where the source had some.
TEST(ScaleFile, ScalesOfTheStreamHaveTangentsWhereTheSourceHadSome) {
  const testing::TemporaryFolder folder;
  const Bytes sheet = compile_sheet(folder, true);
  PackageReader mapped = open(sheet), plain = open(sheet_package());
  const Manifest m = mapped.manifest();
  ASSERT_GT(m.scales.size(), 2u);
  for (const ManifestScale& s : m.scales)
    for (const StreamedNormals normals : {StreamedNormals::kFitted, StreamedNormals::kStreamed}) {
      const Mesh mesh = read_model(scale_file(mapped, s.scale, {}, normals), "x", {}).mesh;
      ASSERT_EQ(mesh.tangents.size(), mesh.wedge_count()) << s.scale;
      std::size_t along = 0;  // few triangles are folded
      for (std::size_t w = 0; w < mesh.wedge_count(); ++w) {
        const Vec4f t = mesh.tangents[w];
        along += t.w == -1 && t.x > 0.7f;
        EXPECT_NEAR(dot(mesh.normals[w], Vec3f{t.x, t.y, t.z}), 0, 0.03);
      }
      EXPECT_GE(along * 10, mesh.wedge_count() * 9) << s.scale;
    }
  for (const ManifestScale& s : plain.manifest().scales)
    EXPECT_TRUE(read_model(scale_file(plain, s.scale, {}), "x", {}).mesh.tangents.empty());
  const StandaloneGlb streamed = scale_file(mapped, m.scales[1].scale, {});
  EXPECT_FALSE(read_model(plain_file(streamed, "x", {}), "x", {}).mesh.tangents.empty());
}

TEST(ScaleFile, IsTheSameForAnyThreadCount) {
  PackageReader package = open(sheet_package());
  const int scale = package.manifest().scales[1].scale;
  RunContext one, eight;
  one.threads = 1, eight.threads = 8;
  EXPECT_EQ(scale_file(package, scale, one).finish(), scale_file(package, scale, eight).finish());
}

TEST(ScaleFile, ADamagedStreamIsFound) {
  const Manifest m = open(sheet_package()).manifest();
  const ManifestScale& s = m.scales[1];
  for (const std::uint64_t at : {std::uint64_t{0}, m.stream->head_bytes, s.glb.bytes - 1}) {
    Bytes damaged = sheet_package();
    damaged[static_cast<std::size_t>(m.stream->offset + at)] ^= 4;
    PackageReader package = open(damaged);
    EXPECT_THROW(package.split_prefix(s.scale), FormatError) << at;
    EXPECT_THROW(scale_file(package, s.scale, {}), FormatError) << at;
  }
  PackageReader package = open(sheet_package());
  EXPECT_THROW(package.scale_glb(s.scale), InputError);
  EXPECT_THROW(package.split_prefix(0), InputError);
}

}  // namespace texmesh::scale_file_test
