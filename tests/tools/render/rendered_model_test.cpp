// What the renderer is given of a model: textures by use, normals, bounds, remarks.
#include "tools/render/rendered_model.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "tests/support/command.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"
#include "tests/support/meshes.h"

namespace texmesh::testing::rendered_model_test {

Image png_image(int side, int channels) {
  Image image;
  image.name = "image";
  image.width_px = image.height_px = static_cast<std::uint32_t>(side);
  image.channels = static_cast<std::uint8_t>(channels);
  image.bits_per_channel = 8;
  image.bytes = png_bytes(side, side, channels);
  return image;
}

TextureRef reference(std::int32_t image, std::uint8_t texcoord = 0) {
  TextureRef ref;
  ref.image = image;
  ref.texcoord = texcoord;
  return ref;
}

ImportedModel sphere_model(const std::vector<Material>& materials, std::vector<Image> images) {
  ImportedModel m;
  m.model.mesh = sphere(6, 8);
  m.model.materials = materials;
  m.model.images = std::move(images);
  return m;
}

TEST(RenderedModel, OneTextureForEveryImageAndKindOfUse) {
  Material a, b;
  a.base_colour_texture = a.emissive_texture = reference(0);
  a.metallic_roughness_texture = a.occlusion_texture = reference(1);
  b.base_colour_texture = reference(1);
  const RenderedModel m = rendered_model(sphere_model({a, b}, {png_image(8, 4), png_image(4, 3)}), {});
  EXPECT_EQ(m.texture_images, (std::vector<TextureImage>{{0, true}, {1, false}, {1, true}}));
  ASSERT_EQ(m.textures.size(), 3u);
  EXPECT_EQ(m.textures[0].levels.front().channels, 4u);  // alpha is kept
  EXPECT_EQ(m.textures[0].levels.size(), 4u);            // 8, 4, 2, 1
  EXPECT_TRUE(m.textures[0].srgb);
  EXPECT_FALSE(m.textures[1].srgb);
  EXPECT_EQ(m.textures[1].levels.front().data, m.textures[2].levels.front().data);
  const auto texture = [&](std::size_t material, TextureUse use) {
    return m.materials[material].slot(use).texture;
  };
  EXPECT_EQ(texture(0, TextureUse::kBaseColour), 0);
  EXPECT_EQ(texture(0, TextureUse::kEmissive), 0);
  EXPECT_EQ(texture(0, TextureUse::kOcclusion), 1);
  EXPECT_EQ(texture(0, TextureUse::kNormal), -1);
  EXPECT_EQ(texture(1, TextureUse::kBaseColour), 2);
  EXPECT_EQ(m.scene().texture_count, 3u);
}

TEST(RenderedModel, CoordinatesThatTheMeshDoesNotHaveReadNothing) {
  Material a;
  a.base_colour_texture = reference(0, 1);
  const RenderedModel m = rendered_model(sphere_model({a}, {png_image(4, 3)}), {});
  EXPECT_EQ(m.materials[0].slot(TextureUse::kBaseColour).texture, -1);
  EXPECT_TRUE(m.textures.empty());
}

TEST(RenderedModel, AbsentNormalsAreFlatInGltfAndSmoothElsewhere) {
  ImportedModel m = sphere_model({Material{}}, {});
  m.model.mesh.normals.clear();
  m.normals_by_specification = true;
  EXPECT_TRUE(rendered_model(m, {}).mesh.normals.empty());
  m.normals_by_specification = false;
  const RenderedModel smooth = rendered_model(m, {});
  ASSERT_EQ(smooth.mesh.normals.size(), smooth.mesh.wedge_count());
  for (std::size_t w = 0; w < smooth.mesh.wedge_count(); ++w)
    EXPECT_GT(dot(smooth.mesh.normals[w], smooth.mesh.positions[smooth.mesh.wedge_position[w]]), 0.9f);
}

TEST(RenderedModel, EveryExtensionThatIsNotRenderedIsNamedOnce) {
  Material a, b;
  a.extensions.push_back({"KHR_materials_transmission", {}, {}});
  a.extensions.push_back({"KHR_materials_emissive_strength", {{"emissiveStrength", {3}}}, {}});
  b.extensions.push_back({"KHR_materials_transmission", {}, {}});
  a.emissive = {1, 0.5f, 0};
  const RenderedModel m = rendered_model(sphere_model({a, b}, {}), {});
  ASSERT_EQ(m.notes.size(), 1u);
  EXPECT_EQ(m.notes[0].code, "not-rendered");
  EXPECT_NE(m.notes[0].text.find("KHR_materials_transmission"), std::string::npos);
  EXPECT_FLOAT_EQ(m.materials[0].emissive.x, 3);
}

TEST(RenderedModel, ImportKeepsWhatARendererReads) {
  GltfBuilder b = quad();
  const auto add = [&b](const char* name, int accessor) {
    b.json["meshes"][0]["primitives"][0]["attributes"][name] = accessor;
  };
  add("NORMAL", b.attribute<float>({0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 1}, "VEC3"));
  add("TANGENT", b.attribute<float>({1, 0, 0, -1, 1, 0, 0, -1, 1, 0, 0, -1, 1, 0, 0, -1}, "VEC4"));
  add("COLOR_0", b.attribute<float>({1, 0, 0, 0.5f, 0, 1, 0, 0.5f, 0, 0, 1, 0.5f, 1, 1, 1, 0.5f}, "VEC4"));
  add("TEXCOORD_1", b.attribute<float>({0, 0, 2, 0, 2, 2, 0, 2}, "VEC2"));
  b.json["images"] = {{{"bufferView", b.view_of(png())}, {"mimeType", "image/png"}}};
  b.json["samplers"] = {{{"wrapS", 33648}, {"wrapT", 33071}, {"magFilter", 9728}}};
  b.json["textures"] = {{{"source", 0}, {"sampler", 0}}};
  const nlohmann::json transform{
      {"KHR_texture_transform", {{"offset", {0.25, 0.5}}, {"rotation", 1}, {"scale", {2, 3}}}}};
  b.json["materials"] = {
      {{"pbrMetallicRoughness",
        {{"baseColorTexture", {{"index", 0}, {"texCoord", 1}, {"extensions", transform}}}}},
       {"normalTexture", {{"index", 0}, {"scale", 0.5}}},
       {"doubleSided", true},
       {"alphaMode", "MASK"},
       {"alphaCutoff", 0.25},
       {"emissiveFactor", {0.5, 0, 0}},
       {"extensions",
        {{"KHR_materials_unlit", nlohmann::json::object()},
         {"KHR_materials_emissive_strength", {{"emissiveStrength", 4}}}}}}};
  b.json["meshes"][0]["primitives"][0]["material"] = 0;
  MemoryResolver none;
  const RenderedModel m = rendered_model(import_gltf("a.glb", b.glb(), none, {}, {}), {});
  const RenderMaterial& material = m.materials.at(0);
  const TextureSlot& slot = material.slot(TextureUse::kBaseColour);
  EXPECT_EQ(slot.uv_set, 1);
  EXPECT_EQ(slot.wrap_s, Wrap::kMirror);
  EXPECT_EQ(slot.wrap_t, Wrap::kClamp);
  EXPECT_EQ(slot.mag_filter, MagFilter::kNearest);
  EXPECT_EQ(slot.transform, (UvTransform{{0.25f, 0.5f}, {2, 3}, 1}));
  EXPECT_TRUE(material.double_sided && material.unlit);
  EXPECT_EQ(material.alpha_mode, AlphaMode::kMask);
  EXPECT_FLOAT_EQ(material.alpha_cutoff, 0.25f);
  EXPECT_FLOAT_EQ(material.normal_scale, 0.5f);
  EXPECT_FLOAT_EQ(material.emissive.x, 2);
  ASSERT_EQ(m.mesh.tangents.size(), 4u);
  EXPECT_EQ(m.mesh.tangents[0], (Vec4f{1, 0, 0, -1}));
  ASSERT_EQ(m.mesh.colours.size(), 4u);
  EXPECT_FLOAT_EQ(m.mesh.colours[0].w, 0.5f);
  EXPECT_TRUE(m.notes.empty());
}

TEST(RenderedModel, UnlitIsForAllMaterials) {
  RenderedModel m = rendered_model(sphere_model({Material{}, Material{}}, {}), {});
  make_unlit(m);
  EXPECT_TRUE(std::all_of(m.materials.begin(), m.materials.end(), [](const auto& x) { return x.unlit; }));
}

TEST(RenderedModel, AnImageThatDoesNotDecodeIsTheModelsFault) {
  Material a;
  a.base_colour_texture = reference(0);
  Image broken = png_image(8, 3);
  broken.bytes.resize(broken.bytes.size() / 2);
  EXPECT_THROW(rendered_model(sphere_model({a}, {broken}), {}), InputError);
  TemporaryFolder folder;
  write_text(folder / "a.mtl", "newmtl m\nmap_Kd t.png\n");
  write_text(folder / "a.obj", "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl m\nf 1/1 2/1 3/1\n");
  write_text(folder / "t.png", {broken.bytes.begin(), broken.bytes.end()});
  try {
    load_rendered_model(folder / "a.obj", {}, {});
    FAIL();
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "a.obj");
    EXPECT_TRUE(e.place().starts_with("t.png: row ")) << e.place();
  }
}

}  // namespace texmesh::testing::rendered_model_test
