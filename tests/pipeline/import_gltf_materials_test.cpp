#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/gltf_builder.h"

namespace texmesh {
namespace {

using nlohmann::json;
using testing::GltfBuilder;
using testing::MemoryResolver;
using testing::png;
using testing::quad;
using testing::webp;

bool has_note(const Model& m, const std::string& code, Severity severity) {
  return std::any_of(m.notes.begin(), m.notes.end(),
                     [&](const Note& n) { return n.code == code && n.severity == severity; });
}

/// A quad with one material, "a.png" as texture 0 and both sets of UVs.
GltfBuilder textured(json material) {
  GltfBuilder b = quad();
  json& primitive = b.json["meshes"][0]["primitives"][0];
  primitive["attributes"]["TEXCOORD_1"] = primitive["attributes"]["TEXCOORD_0"];
  primitive["material"] = 0;
  b.json["materials"] = {std::move(material)};
  b.json["textures"] = {{{"source", 0}}};
  b.json["images"] = {{{"uri", "a.png"}}};
  return b;
}
json base_colour(json info = {{"index", 0}}) {
  return {{"pbrMetallicRoughness", {{"baseColorTexture", std::move(info)}}}};
}

Model import(const GltfBuilder& b, MemoryResolver& resolver) {
  return import_gltf("m.glb", b.glb(), resolver, {}, {}).model;
}
Model import(const GltfBuilder& b) {
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  return import(b, resolver);
}

TEST(ImportGltfMaterials, ReadsEveryProperty) {
  GltfBuilder b = textured({{"name", "skin"},
                            {"pbrMetallicRoughness",
                             {{"baseColorFactor", {0.5, 0.25, 0.125, 0.75}},
                              {"metallicFactor", 0.25},
                              {"roughnessFactor", 0.5},
                              {"baseColorTexture", {{"index", 0}}},
                              {"metallicRoughnessTexture", {{"index", 0}, {"texCoord", 1}}}}},
                            {"normalTexture", {{"index", 0}, {"scale", -2}}},
                            {"occlusionTexture", {{"index", 0}, {"strength", 0.5}}},
                            {"emissiveTexture", {{"index", 0}}},
                            {"emissiveFactor", {0.125, 0.25, 0.5}},
                            {"alphaMode", "MASK"},
                            {"alphaCutoff", 0.25},
                            {"doubleSided", true},
                            {"extensions", {{"KHR_materials_unlit", json::object()}}}});
  b.json["textures"][0]["sampler"] = 0;
  b.json["samplers"] = {{{"wrapS", 33071}, {"wrapT", 33648}, {"magFilter", 9728}}};
  const Model m = import(b);
  const Material& r = m.materials.at(0);
  EXPECT_EQ(r.name, "skin");
  EXPECT_EQ(r.base_colour, (Vec4f{0.5f, 0.25f, 0.125f, 0.75f}));
  EXPECT_EQ(r.metallic, 0.25f);
  EXPECT_EQ(r.roughness, 0.5f);
  EXPECT_EQ(r.emissive, (Vec3f{0.125f, 0.25f, 0.5f}));
  EXPECT_EQ(r.normal_scale, -2.0f);
  EXPECT_EQ(r.occlusion_strength, 0.5f);
  EXPECT_EQ(r.alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(r.alpha_cutoff, 0.25f);
  EXPECT_TRUE(r.double_sided && r.unlit);
  for (const TextureRef& t : {r.base_colour_texture, r.metallic_roughness_texture, r.normal_texture,
                              r.occlusion_texture, r.emissive_texture}) {
    EXPECT_EQ(t.image, 0);
    EXPECT_EQ(t.wrap_s, Wrap::kClamp);
    EXPECT_EQ(t.wrap_t, Wrap::kMirror);
    EXPECT_TRUE(t.nearest);
  }
  EXPECT_EQ(r.base_colour_texture.texcoord, 0);
  EXPECT_EQ(r.metallic_roughness_texture.texcoord, 1);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
  EXPECT_TRUE(m.notes.empty());
}

TEST(ImportGltfMaterials, KeepsTextureTransforms) {
  const json transform = {{"offset", {0.25, 0.5}}, {"scale", {2, 3}}, {"rotation", 1.5}, {"texCoord", 1}};
  const Model m =
      import(textured(base_colour({{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}})));
  const TextureRef& t = m.materials.at(0).base_colour_texture;
  EXPECT_EQ(t.transform.offset, (Vec2f{0.25f, 0.5f}));
  EXPECT_EQ(t.transform.scale, (Vec2f{2, 3}));
  EXPECT_EQ(t.transform.rotation, 1.5f);
  EXPECT_EQ(t.texcoord, 1);
}

TEST(ImportGltfMaterials, ReadsImagesFromBufferViewsAndDataUris) {
  GltfBuilder b = textured(base_colour());
  b.json["images"] = {{{"bufferView", b.view_of(png())}, {"mimeType", "image/png"}, {"name", "skin/colour"}}};
  Model m = import(b);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
  EXPECT_EQ(m.images[0].name, "colour");
  b.json["images"] = {
      {{"uri",
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGA"
        "WjR9awAAAABJRU5ErkJggg=="}}};
  m = import(b);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
}

TEST(ImportGltfMaterials, PrefersWebpAndFallsBackWhenItIsMissing) {
  GltfBuilder b = textured(base_colour());
  b.json["images"].push_back({{"uri", "b.webp"}});
  b.json["textures"][0]["extensions"] = {{"EXT_texture_webp", {{"source", 1}}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"EXT_texture_webp"};
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  resolver.files["b.webp"] = webp();
  Model m = import(b, resolver);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].format, ImageFormat::kWebp);
  EXPECT_EQ(resolver.asked, (std::vector<std::string>{"b.webp"}));
  resolver.files.erase("b.webp");
  m = import(b, resolver);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].format, ImageFormat::kPng);
}

TEST(ImportGltfMaterials, AMissingImageIsAWarning) {
  MemoryResolver empty;
  const Model m = import(textured(base_colour()), empty);
  EXPECT_TRUE(has_note(m, "missing-texture", Severity::kWarning));
  EXPECT_FALSE(m.materials.at(0).base_colour_texture.used());
  EXPECT_TRUE(m.images.empty());
}

TEST(ImportGltfMaterials, ATextureOfAnotherKindOnlyIsAWarning) {
  GltfBuilder b = textured(base_colour());
  b.json["textures"][0] = {{"extensions", {{"KHR_texture_basisu", {{"source", 0}}}}}};
  const Model m = import(b);
  EXPECT_TRUE(has_note(m, "missing-texture", Severity::kWarning));
  EXPECT_FALSE(m.materials.at(0).base_colour_texture.used());
}

TEST(ImportGltfMaterials, HugeNumbersStayFinite) {
  const json transform = {{"offset", {1e300, -1e300}}, {"rotation", 1e300}};
  json material = base_colour({{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}});
  material["alphaCutoff"] = 1e300;
  material["normalTexture"] = {{"index", 0}, {"scale", -1e300}};
  const Material r = import(textured(material)).materials.at(0);
  for (const float v : {r.alpha_cutoff, r.normal_scale, r.base_colour_texture.transform.offset.x,
                        r.base_colour_texture.transform.offset.y, r.base_colour_texture.transform.rotation}) {
    EXPECT_LT(std::fabs(v), 1e31f);
  }
}

TEST(ImportGltfMaterials, NeverOpensImagesOfUnusedMaterials) {
  GltfBuilder b = textured(base_colour());
  b.json["materials"].push_back(base_colour({{"index", 1}}));
  b.json["textures"].push_back({{"source", 1}});
  b.json["images"].push_back({{"uri", "unused.png"}});
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  EXPECT_EQ(import(b, resolver).materials.size(), 1u);
  EXPECT_EQ(resolver.asked, (std::vector<std::string>{"a.png"}));
}

TEST(ImportGltfMaterials, ReadsSpecularGlossinessAsItsDiffusePart) {
  json material = base_colour({{"index", 1}});
  material["extensions"]["KHR_materials_pbrSpecularGlossiness"] = {
      {"diffuseFactor", {0.5, 0.25, 1, 1}}, {"glossinessFactor", 0.75}, {"diffuseTexture", {{"index", 0}}}};
  GltfBuilder b = textured(material);
  b.json["textures"].push_back({{"source", 1}});
  b.json["images"].push_back({{"uri", "metal.png"}});
  const Model m = import(b);
  EXPECT_TRUE(has_note(m, "specular-glossiness", Severity::kInfo));
  EXPECT_EQ(m.materials.at(0).base_colour, (Vec4f{0.5f, 0.25f, 1, 1}));
  EXPECT_EQ(m.materials.at(0).metallic, 0.0f);
  EXPECT_EQ(m.materials.at(0).roughness, 0.25f);
  EXPECT_TRUE(m.materials.at(0).base_colour_texture.used());
}

TEST(ImportGltfMaterials, TexturesThatNoUvReachesAreLeftOut) {
  GltfBuilder far = textured(base_colour({{"index", 0}, {"texCoord", 2}}));
  Model m = import(far);
  EXPECT_TRUE(has_note(m, "unsupported-texcoord", Severity::kWarning));
  EXPECT_FALSE(m.materials.at(0).base_colour_texture.used());

  GltfBuilder none = textured(base_colour());
  none.json["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_0");
  none.json["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_1");
  m = import(none);
  EXPECT_TRUE(has_note(m, "texture-without-uv", Severity::kWarning));
  EXPECT_TRUE(m.images.empty());
}

TEST(ImportGltfMaterials, NotesEveryUnknownExtensionOnce) {
  json material = base_colour();
  material["extensions"] = {{"KHR_materials_clearcoat", {{"clearcoatFactor", 1}}}};
  GltfBuilder b = textured(material);
  b.json["extensionsUsed"] = {"KHR_materials_clearcoat"};
  EXPECT_EQ(import(b).notes.size(), 1u);
}

TEST(ImportGltfMaterials, RefusesImagesOfForeignContentAndForeignPlaces) {
  const auto refused = [](const char* uri, testing::Bytes bytes) {
    GltfBuilder b = textured(base_colour());
    b.json["images"][0]["uri"] = uri;
    MemoryResolver resolver;
    resolver.files[uri] = std::move(bytes);
    try {
      import(b, resolver);
      ADD_FAILURE() << uri;
    } catch (const InputError& e) {
      EXPECT_EQ(e.file(), "m.glb") << e.what();
      EXPECT_EQ(e.place().rfind("/images/0", 0), 0u) << e.what();
    }
  };
  refused("a.png", {'G', 'I', 'F', '8', '9', 'a'});
  refused("a.png", {});
  for (const char* uri :
       {"../a.png", "%2e%2e/a.png", "/a.png", "http://x/a.png", "file:///a.png", ".", "a%00.png"}) {
    refused(uri, png());
  }
}

}  // namespace
}  // namespace texmesh
