#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "format/model/material_extensions.h"
#include "stages/image/decode_image.h"
#include "tests/pipeline/import/gltf/textured_gltf.h"

namespace texmesh::import_gltf_materials_test {

using namespace testing;  // NOLINT: fixtures

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
  const Model m = import_built(b);
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
    EXPECT_EQ(t.minification, Minification::kLinearMipmapLinear);
  }
  EXPECT_EQ(r.base_colour_texture.texcoord, 0);
  EXPECT_EQ(r.metallic_roughness_texture.texcoord, 1);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
  EXPECT_TRUE(m.notes.empty());
}

TEST(ImportGltfMaterials, KeepsEveryMinificationFilter) {
  for (const auto& [code, kind] : {std::pair{9728, Minification::kNearest},
                                   {9729, Minification::kLinear},
                                   {9984, Minification::kNearestMipmapNearest},
                                   {9985, Minification::kLinearMipmapNearest},
                                   {9986, Minification::kNearestMipmapLinear},
                                   {9987, Minification::kLinearMipmapLinear}}) {
    GltfBuilder b = textured(base_colour());
    b.json["textures"][0]["sampler"] = 0;
    b.json["samplers"] = {{{"minFilter", code}}};
    const TextureRef t = import_built(b).materials.at(0).base_colour_texture;
    EXPECT_EQ(t.minification, kind) << code;
    EXPECT_FALSE(t.nearest);
  }
  GltfBuilder wrong = textured(base_colour());
  wrong.json["samplers"] = {{{"minFilter", 9730}}};
  EXPECT_THROW(import_built(wrong), InputError);
}

TEST(ImportGltfMaterials, KeepsTextureTransforms) {
  const json transform = {{"offset", {0.25, 0.5}}, {"scale", {2, 3}}, {"rotation", 1.5}, {"texCoord", 1}};
  const Model m = import_built(
      textured(base_colour({{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}})));
  const TextureRef& t = m.materials.at(0).base_colour_texture;
  EXPECT_EQ(t.transform.offset, (Vec2f{0.25f, 0.5f}));
  EXPECT_EQ(t.transform.scale, (Vec2f{2, 3}));
  EXPECT_EQ(t.transform.rotation, 1.5f);
  EXPECT_EQ(t.texcoord, 1);
}

TEST(ImportGltfMaterials, HugeNumbersStayFinite) {
  const json transform = {{"offset", {1e300, -1e300}}, {"rotation", 1e300}};
  json material = base_colour({{"index", 0}, {"extensions", {{"KHR_texture_transform", transform}}}});
  material["alphaCutoff"] = 1e300;
  material["normalTexture"] = {{"index", 0}, {"scale", -1e300}};
  const Material r = import_built(textured(material)).materials.at(0);
  for (const float v : {r.alpha_cutoff, r.normal_scale, r.base_colour_texture.transform.offset.x,
                        r.base_colour_texture.transform.offset.y, r.base_colour_texture.transform.rotation}) {
    EXPECT_LT(std::fabs(v), 1e31f);
  }
}

TEST(ImportGltfMaterials, SpecularGlossinessBecomesMetallicRoughness) {
  json material = base_colour({{"index", 1}});
  json& e = material["extensions"]["KHR_materials_pbrSpecularGlossiness"];
  e = {{"diffuseFactor", {0, 0, 0, 0.5}}, {"specularFactor", {1, 0.5, 0.25}}, {"glossinessFactor", 0.75}};
  const auto read = [&] {
    GltfBuilder b = textured(material);
    b.json["textures"].push_back({{"source", 1}});
    b.json["images"].push_back({{"uri", "metal.png"}});
    return import_built(b);
  };
  const Model metal = read();  // no diffuse light: a metal
  EXPECT_TRUE(has_note(metal, "specular-glossiness", Severity::kInfo));
  const Material& m = metal.materials.at(0);
  EXPECT_NEAR(m.base_colour.x, 1, 1e-3);
  EXPECT_NEAR(m.base_colour.y, 0.5, 0.01);
  EXPECT_NEAR(m.base_colour.z, 0.25, 0.01);
  EXPECT_EQ(m.base_colour.w, 0.5f);
  EXPECT_NEAR(m.metallic, 1, 1e-3);
  EXPECT_EQ(m.roughness, 0.25f);
  EXPECT_FALSE(m.base_colour_texture.used());
  EXPECT_TRUE(m.extensions.empty());

  e["diffuseTexture"] = {{"index", 0}};
  const Model with_texture = read();
  EXPECT_TRUE(with_texture.materials.at(0).base_colour_texture.used());
  EXPECT_TRUE(with_texture.materials.at(0).metallic_roughness_texture.used());
  EXPECT_EQ(with_texture.materials.at(0).base_colour, (Vec4f{1, 1, 1, 0.5f}));
  EXPECT_EQ(with_texture.images.size(), 2u);  // the source's own are not needed any more
  EXPECT_EQ(with_texture.notes.size(), 1u);

  e["specularGlossinessTexture"] = {{"index", 0}, {"texCoord", 1}};
  const Model elsewhere = read();
  EXPECT_TRUE(has_note(elsewhere, "specular-glossiness-mean", Severity::kWarning));
  EXPECT_TRUE(elsewhere.materials.at(0).base_colour_texture.used());
}

TEST(ImportGltfMaterials, TexturesThatNoUvReachesAreLeftOut) {
  GltfBuilder far = textured(base_colour({{"index", 0}, {"texCoord", 2}}));
  Model m = import_built(far);
  EXPECT_TRUE(has_note(m, "unsupported-texcoord", Severity::kWarning));
  EXPECT_FALSE(m.materials.at(0).base_colour_texture.used());

  GltfBuilder none = textured(base_colour());
  none.json["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_0");
  none.json["meshes"][0]["primitives"][0]["attributes"].erase("TEXCOORD_1");
  m = import_built(none);
  EXPECT_TRUE(has_note(m, "texture-without-uv", Severity::kWarning));
  EXPECT_TRUE(m.images.empty());
}

/// Every property of every extension that is carried, each texture another image.
json all_extensions(GltfBuilder& b, MemoryResolver& resolver) {
  json out;
  for (const MaterialExtensionKind& kind : material_extensions()) {
    if (kind.converted) continue;
    json& e = out[std::string(kind.name)] = json::object();
    for (const ExtensionFactorKind& f : kind.factors) {
      if (f.components == 1)
        e[std::string(f.key)] = 1;
      else
        e[std::string(f.key)] = std::vector<double>(static_cast<std::size_t>(f.components), 0.5);
    }
    for (const ExtensionTextureKind& t : kind.textures) {
      const std::string file = std::string(kind.name) + "." + std::string(t.key) + ".png";
      resolver.files[file] = testing::png();
      resolver.files[file].push_back(static_cast<std::uint8_t>(resolver.files.size()));  // no two alike
      e[std::string(t.key)] = {{"index", b.push("textures", {{"source", b.push("images", {{"uri", file}})}})},
                               {"texCoord", 1}};
      if (t.tangent_space) e[std::string(t.key)]["scale"] = 0.25;
    }
  }
  return out;
}

TEST(ImportGltfMaterials, EveryTextureOfEveryExtensionIsRead) {
  GltfBuilder b = textured(base_colour());
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  b.json["materials"][0]["extensions"] = all_extensions(b, resolver);
  for (const auto& [name, value] : b.json["materials"][0]["extensions"].items()) {
    b.json["extensionsUsed"].push_back(name);
    b.json["extensionsRequired"].push_back(name);
  }
  const Model m = import_built(b, resolver);
  EXPECT_TRUE(m.notes.empty());
  const Material& r = m.materials.at(0);
  std::vector<MaterialExtensionKind> carried;
  for (const MaterialExtensionKind& kind : material_extensions())
    if (!kind.converted) carried.push_back(kind);
  ASSERT_EQ(r.extensions.size(), carried.size());
  std::size_t textures = 0;
  for (std::size_t e = 0; e < r.extensions.size(); ++e) {
    const MaterialExtensionKind& kind = carried[e];
    EXPECT_EQ(r.extensions[e].name, kind.name);
    ASSERT_EQ(r.extensions[e].factors.size(), kind.factors.size());
    for (std::size_t f = 0; f < kind.factors.size(); ++f) {
      EXPECT_EQ(r.extensions[e].factors[f].key, kind.factors[f].key);
      EXPECT_EQ(r.extensions[e].factors[f].values,
                std::vector<float>(static_cast<std::size_t>(kind.factors[f].components),
                                   kind.factors[f].components == 1 ? 1.0f : 0.5f));
    }
    ASSERT_EQ(r.extensions[e].textures.size(), kind.textures.size()) << kind.name;
    for (std::size_t t = 0; t < kind.textures.size(); ++t) {
      const ExtensionTexture& texture = r.extensions[e].textures[t];
      EXPECT_EQ(texture.key, kind.textures[t].key);
      EXPECT_EQ(texture.texture.texcoord, 1);
      EXPECT_EQ(texture.scale, kind.textures[t].tangent_space ? 0.25f : 1.0f);
      const std::string name = std::string(kind.name) + "." + std::string(kind.textures[t].key) + ".png";
      EXPECT_EQ(m.images.at(static_cast<std::size_t>(texture.texture.image)).name, name);
      ++textures;
    }
  }
  EXPECT_EQ(m.images.size(), textures + 1);  // and the base colour
  EXPECT_EQ(textures, 14u);
}

TEST(ImportGltfMaterials, ExtensionsOfTheWrongKindAreRefused) {
  const auto refused = [](const char* extension, json value, const std::string& place) {
    json material = base_colour();
    material["extensions"][extension] = std::move(value);
    try {
      import_built(textured(material));
      ADD_FAILURE() << place;
    } catch (const InputError& e) {
      EXPECT_EQ(e.place(), "/materials/0/extensions/" + std::string(extension) + place) << e.what();
    }
  };
  refused("KHR_materials_clearcoat", {{"clearcoatFactor", "much"}}, "/clearcoatFactor");
  refused("KHR_materials_sheen", {{"sheenColorFactor", {1, 2}}}, "/sheenColorFactor");
  refused("KHR_materials_volume", {{"thicknessTexture", {{"index", 9}}}}, "/thicknessTexture/index");
  refused("KHR_materials_specular", json::array(), "");
}

TEST(ImportGltfMaterials, NotesWhatIsLostWithAnUnknownExtensionOnce) {
  json material = base_colour();
  material["extensions"] = {{"EXT_plush", {{"fibres", 1}, {"fibreTexture", {{"index", 0}}}}}};
  GltfBuilder b = textured(material);
  b.json["materials"].push_back(b.json["materials"][0]);
  b.json["extensionsUsed"] = {"EXT_plush"};
  const Model m = import_built(b);
  ASSERT_EQ(m.notes.size(), 2u);
  EXPECT_EQ(m.notes[1].text, "EXT_plush is left out, and with it the textures fibreTexture");
  EXPECT_EQ(m.notes[1].severity, Severity::kWarning);
}

TEST(ImportGltfMaterials, TangentsFollowTheNodes) {
  GltfBuilder b = textured(base_colour());
  b.json["materials"][0]["normalTexture"] = {{"index", 0}};
  json& attributes = b.json["meshes"][0]["primitives"][0]["attributes"];
  attributes["NORMAL"] = b.attribute<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3");
  attributes["TANGENT"] = b.attribute<float>({1, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, -1, 1, 0, 0, 1}, "VEC4");
  EXPECT_EQ(import_built(b).mesh.tangents,
            (std::vector<Vec4f>{{1, 0, 0, 1}, {1, 0, 0, 1}, {1, 0, 0, -1}, {1, 0, 0, 1}}));
  b.json["nodes"][0]["scale"] = {-2, 3, 1};  // a mirror
  EXPECT_EQ(import_built(b).mesh.tangents[0], (Vec4f{-1, 0, 0, -1}));
  b.json["nodes"].push_back({{"mesh", 0}});
  EXPECT_EQ(import_built(b).mesh.tangents.size(), 8u);
  attributes.erase("NORMAL");
  EXPECT_TRUE(import_built(b).mesh.tangents.empty()) << "glTF: ignored without normals";
}

}  // namespace texmesh::import_gltf_materials_test
