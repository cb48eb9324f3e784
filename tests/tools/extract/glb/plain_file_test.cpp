// Files without extensions that compress.
#include "tools/extract/glb/standalone_glb.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pipeline/import/import.h"
#include "pipeline/io/file_resolver.h"
#include "stages/gltf/check_glb.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tests/support/packages.h"
#include "tools/extract/extract.h"
#include "tools/extract/proxy/proxy_search.h"

namespace texmesh::plain_file_test {

nlohmann::json json_of(const Bytes& glb) {
  const std::size_t bytes = glb[12] | glb[13] << 8 | glb[14] << 16;
  return nlohmann::json::parse(glb.begin() + 20, glb.begin() + 20 + static_cast<std::ptrdiff_t>(bytes));
}

void expect_plain(const Bytes& glb, std::uint64_t triangles) {
  Findings findings;
  const GlbFacts facts = check_glb(glb, "x.glb", findings, GlbRules::kStandalone);
  for (const Finding& f : findings.list()) ADD_FAILURE() << to_string(f);
  EXPECT_EQ(facts.triangles, triangles);
  EXPECT_EQ(facts.codec, "none");
  EXPECT_FALSE(json_of(glb).contains("extensionsRequired"));
}

testing::GltfBuilder lone_quad() {
  testing::GltfBuilder b = testing::quad();
  b.json["accessors"][0]["max"] = {1, 1, 0};
  b.json["nodes"][0]["name"] = "part";
  b.json["scenes"] = {{{"nodes", {0}}}};
  b.json["scene"] = 0;
  return b;
}

/// A quad with a WebP texture under Draco; its second material is the one that triangles have.
StandaloneGlb compressed_quad() {
  testing::GltfBuilder b = lone_quad();
  const int image =
      b.push("images", {{"bufferView", b.view_of(testing::png_bytes(8, 8, 3))}, {"mimeType", "image/png"}});
  b.push("textures", {{"source", image}});
  b.push("materials",
         {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 0}}}}}, {"name", "painted"}});
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  const auto parts = ProxyParts::read(b.glb(), "quad", {});
  StandaloneGlb out = parts->file({}, parts->coded(0, {0.001, 0.001, 8}, {}));
  out.set_images({{0, {FileImage::kWebp, encode_image(parts->maps({})[0].pixels, {FileImage::kWebp, 90})}}});
  return out;
}

TEST(PlainFile, DracoAndWebpBecomeFloatsAndPng) {
  const StandaloneGlb compressed = compressed_quad();
  ASSERT_TRUE(json_of(compressed.finish()).contains("extensionsRequired"));
  const Bytes glb = plain_file(compressed, "x", {}).finish();
  expect_plain(glb, 2);
  EXPECT_EQ(json_of(glb)["images"][0]["mimeType"], "image/png");
  NoFiles none;
  const Model before = import_gltf("x.glb", compressed.finish(), none, {}, {}).model,
              after = import_gltf("x.glb", glb, none, {}, {}).model;
  EXPECT_EQ(after.mesh.positions.size(), before.mesh.positions.size());
  EXPECT_EQ(after.materials[0].name, before.materials[0].name);
  EXPECT_EQ(after.mesh.part_names, before.mesh.part_names);
  EXPECT_EQ(plain_file(compressed, "x", {}).finish(), glb);
}

TEST(PlainFile, TrianglesWithoutAMaterialHaveNoneAfterwards) {
  for (const bool beside_others : {false, true}) {
    testing::GltfBuilder b = lone_quad();
    auto& primitives = b.json["meshes"][0]["primitives"];
    if (beside_others) {
      b.push("materials", {{"name", "painted"}});
      auto other = primitives[0];
      other["material"] = 0;
      primitives.push_back(other);
    }
    const StandaloneGlb file(b.glb(), "quad", GlbRules::kStandalone);
    const Bytes glb = plain_file(file, "x", {}).finish();
    expect_plain(glb, beside_others ? 4 : 2);
    const auto found = json_of(glb)["meshes"][0]["primitives"];
    EXPECT_FALSE(found[0].contains("material"));
    if (beside_others) EXPECT_EQ(found.at(1)["material"], 0);
  }
}

TEST(PlainFile, ScalesAndProxiesOfAPackageArePlainWhereItIsAsked) {
  testing::PackageParts parts = testing::make_package_parts();
  testing::add_proxies(parts);
  const Bytes bytes = parts.build();
  PackageReader package(open_container(memory_source(bytes)));
  for (const bool of_proxy : {false, true}) {
    ExtractRequest r{ExtractProxy{1, true}};
    if (!of_proxy) {
      ExtractScale scale;
      scale.scale = 0;
      scale.form = ExtractScale::Form::kPlain;
      r.file = scale;
    }
    const Extracted e = extract_model(package, r, {});
    expect_plain(e.glb, testing::fine_mesh().triangles.size());
    Findings findings;
    EXPECT_NEAR(check_glb(e.glb, "x.glb", findings, GlbRules::kStandalone).bounds_min.x, 9, 1e-3);
  }
}

}  // namespace texmesh::plain_file_test
