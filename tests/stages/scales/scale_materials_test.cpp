// Materials, their textures' previews and tangents in the files of the scales.
#include "pipeline/import/import_images.h"
#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "tests/stages/scales/scales_checks.h"

namespace texmesh::scale_materials_test {

using namespace testing;  // NOLINT: fixtures and checks

TEST(Scales, MaterialsCarryWhatTheSourceSays) {
  Case c(testing::cube(), 2);
  c.add_image(TextureRole::kBaseColour, true);
  c.add_image(TextureRole::kNormal);
  Material& m = c.materials[0];
  m.name = "glass";
  m.base_colour = {0.1f, 0.2f, 0.3f, 0.4f};
  m.metallic = 0.25f, m.roughness = 1.5f;
  m.emissive = {1, 0.5f, 0};
  m.alpha_mode = AlphaMode::kMask, m.alpha_cutoff = 0.3f;
  m.double_sided = m.unlit = true;
  m.base_colour_texture = {0,
                           0,
                           Wrap::kClamp,
                           Wrap::kMirror,
                           true,
                           Minification::kNearestMipmapNearest,
                           {{0.5f, 0}, {2, 3}, 0.25f}};
  m.normal_texture.image = 1, m.normal_scale = 0.5f;
  c.materials[1].alpha_mode = AlphaMode::kBlend;
  c.materials[1].base_colour_texture.image = 0;
  const Glb glb = open(c.write(MeshCodec::kDraco).files[0].glb);
  const Json& j = glb.json["materials"][0];
  EXPECT_EQ(j["name"], "glass");
  EXPECT_EQ(j["pbrMetallicRoughness"]["baseColorFactor"], Json::parse("[0.1,0.2,0.3,0.4]"));
  EXPECT_EQ(j["pbrMetallicRoughness"]["metallicFactor"], 0.25);
  EXPECT_EQ(j["pbrMetallicRoughness"]["roughnessFactor"], 1.0);
  EXPECT_EQ(j["emissiveFactor"], Json::parse("[1.0,0.5,0.0]"));
  EXPECT_EQ(j["alphaMode"], "MASK");
  EXPECT_EQ(j["alphaCutoff"], 0.3);
  EXPECT_EQ(j["doubleSided"], true);
  EXPECT_TRUE(j["extensions"].contains("KHR_materials_unlit"));
  const Json& t = j["pbrMetallicRoughness"]["baseColorTexture"];
  EXPECT_EQ(t["extensions"]["KHR_texture_transform"],
            Json::parse(R"({"offset":[0.5,0.0],"rotation":0.25,"scale":[2.0,3.0]})"));
  const Json& texture = glb.json["textures"][t["index"].get<std::size_t>()];
  EXPECT_EQ(glb.json["samplers"][texture["sampler"].get<std::size_t>()],
            Json::parse(R"({"magFilter":9728,"minFilter":9984,"wrapS":33071,"wrapT":33648})"));
  EXPECT_EQ(j["normalTexture"]["scale"], 0.5);
  EXPECT_EQ(glb.json["materials"][1]["alphaMode"], "BLEND");
  ASSERT_EQ(glb.json["images"].size(), 2u);
  EXPECT_EQ(glb.json["images"][0]["name"], "texture/0");
  EXPECT_EQ(glb.json["images"][0]["mimeType"], "image/png");
  EXPECT_EQ(glb.json["images"][1]["name"], "texture/1");
  EXPECT_EQ(view_bytes(glb, glb.json["images"][1]["bufferView"]), c.previews.planes[2].file);

  // The PNG holds the colours of one preview and the alpha of the other.
  Image png = probe_image("preview", view_bytes(glb, glb.json["images"][0]["bufferView"]), {});
  EXPECT_EQ(png.channels, 4);
  const Pixels both = decode_image(png), colour = decode_jpeg(c.previews.planes[0].file, 1 << 20);
  const Pixels alpha = decode_jpeg(c.previews.planes[1].file, 1 << 20);
  ASSERT_EQ(both.width_px, 32u);
  for (std::uint32_t y = 0; y < 32; ++y)
    for (std::uint32_t x = 0; x < 32; ++x) {
      EXPECT_EQ(both.at(x, y)[1], colour.at(x, y)[1]);
      EXPECT_EQ(both.at(x, y)[3], *alpha.at(2 * x, 2 * y));
    }
}

TEST(Scales, SamplersFilterAsTheSourceSays) {
  const std::vector<std::pair<Minification, int>> codes{{Minification::kLinearMipmapLinear, 9987},
                                                        {Minification::kNearest, 9728},
                                                        {Minification::kLinear, 9729},
                                                        {Minification::kNearestMipmapNearest, 9984},
                                                        {Minification::kLinearMipmapNearest, 9985},
                                                        {Minification::kNearestMipmapLinear, 9986}};
  Case c(testing::cube(), 2 * codes.size());
  c.add_image(TextureRole::kBaseColour);
  for (std::size_t k = 0; k < c.materials.size(); ++k) {
    TextureRef& t = c.materials[k].base_colour_texture;
    t.image = 0, t.minification = codes[k / 2].first, t.nearest = k % 2 == 1;
  }
  const Glb glb = open(c.write(MeshCodec::kNone).files[0].glb);
  EXPECT_EQ(glb.json["samplers"].size(), c.materials.size());
  for (std::size_t k = 0; k < c.materials.size(); ++k) {
    const Json& info = glb.json["materials"][k]["pbrMetallicRoughness"]["baseColorTexture"];
    const Json& texture = glb.json["textures"][info["index"].get<std::size_t>()];
    const Json& sampler = glb.json["samplers"][texture["sampler"].get<std::size_t>()];
    EXPECT_EQ(sampler["minFilter"], codes[k / 2].second);
    EXPECT_EQ(sampler["magFilter"], k % 2 == 1 ? 9728 : 9729);
  }
}

TEST(Scales, MaterialExtensionsComeBackAsTheyWere) {
  Case c(testing::cube());
  c.add_image(TextureRole::kData);
  c.add_image(TextureRole::kNormal);
  TextureRef data, normal, unseen;
  data.image = 0, normal.image = 1;
  data.transform.scale = {2, 2};
  unseen.image = 0, unseen.texcoord = 1;  // the mesh has no such coordinates
  c.materials[0].extensions = {
      {"KHR_materials_clearcoat",
       {{"clearcoatFactor", {0.1f}}},
       {{"clearcoatTexture", data}, {"clearcoatNormalTexture", normal, 0.5f}}},
      {"KHR_materials_ior", {{"ior", {1.4f}}}, {}},
      {"KHR_materials_sheen", {{"sheenColorFactor", {0, 0.5f, 1}}}, {{"sheenColorTexture", unseen}}}};
  const Glb glb = open(c.write(MeshCodec::kDraco).files[0].glb);
  const Json& e = glb.json["materials"][0]["extensions"];
  EXPECT_EQ(e["KHR_materials_clearcoat"], Json::parse(R"({"clearcoatFactor":0.1,
      "clearcoatTexture":{"index":0,"extensions":{"KHR_texture_transform":{"scale":[2.0,2.0]}}},
      "clearcoatNormalTexture":{"index":1,"scale":0.5}})"));
  EXPECT_EQ(e["KHR_materials_ior"], Json::parse(R"({"ior":1.4})"));
  EXPECT_EQ(e["KHR_materials_sheen"], Json::parse(R"({"sheenColorFactor":[0.0,0.5,1.0]})"));
  const std::vector<std::string> used = glb.json["extensionsUsed"];
  for (const char* name : {"KHR_materials_clearcoat", "KHR_materials_ior", "KHR_materials_sheen"})
    EXPECT_EQ(std::count(used.begin(), used.end(), name), 1) << name;
  for (const auto& name : glb.json["extensionsRequired"]) EXPECT_EQ(name, "KHR_draco_mesh_compression");
}

TEST(Scales, TangentsOfTheSourceComeWhereANormalMapNeedsThem) {
  Mesh m = testing::bumpy_sphere(14, 20);
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const Vec3f p = m.positions[m.wedge_position[w]];
    const float l = std::sqrt(p.x * p.x + p.z * p.z), sign = w % 2 ? 1.0f : -1.0f;
    m.tangents.push_back(l > 1e-3f ? Vec4f{p.z / l, 0, -p.x / l, sign} : Vec4f{1, 0, 0, sign});
  }
  for (std::size_t t = 0; t < m.triangles.size(); ++t) m.triangle_material[t] = t % 3 == 0;
  Case c(m, 2);
  c.add_image(TextureRole::kNormal);
  c.materials[1].normal_texture.image = 0;
  for (MeshCodec codec : kCodecs)
    for (int bits : {8, 9, 10}) {
      const ScaleFiles files = c.write(codec, {.tangent_bits = bits});
      Vec3d translation;
      double step = 1;
      for (const ScaleFile& file : files.files)
        for (const Primitive& p : read(open(file.glb), translation, step)) {
          ASSERT_EQ(p.tangents.size(), p.material == 1 ? p.positions.size() : 0u);
          for (std::size_t i = 0; i < p.tangents.size(); ++i) {
            const auto& t = p.tangents[i];
            EXPECT_TRUE(t[3] == 1.0f || t[3] == -1.0f) << t[3];
            EXPECT_NEAR(std::sqrt(t[0] * t[0] + t[1] * t[1] + t[2] * t[2]), 1, 0.01);
            const double x = p.positions[i][0] * step + translation.x,
                         z = p.positions[i][2] * step + translation.z;
            // Along the circle of latitude; coarser scales have wedges that came from a neighbour's place.
            EXPECT_NEAR(t[0] * x + t[2] * z, 0, file.scale == 0 ? 0.02 : 0.5);
          }
        }
    }
  c.scales.mesh
      .tangents[c.scales.scales[0].triangles[0][0]] = {};  // a wedge without: nothing for its primitive
  Vec3d translation;
  double step = 1;
  for (const Primitive& p : read(open(c.write(MeshCodec::kDraco).files[0].glb), translation, step))
    if (c.scales.mesh.triangle_material[c.scales.scales[0].triangle_source[0]] == p.material) {
      EXPECT_TRUE(p.tangents.empty());
    }
}

TEST(Scales, PngOfEveryKindReadsBack) {
  for (std::uint32_t channels : {1u, 3u, 4u}) {
    const Pixels p = picture(37, 21, channels);
    EXPECT_EQ(decode_image(probe_image("made", write_png(p), {})).data, p.data);
  }
  EXPECT_THROW(write_png(picture(3, 3, 2)), StageError);
  EXPECT_THROW(write_png(Pixels{}), StageError);
}

TEST(Scales, TheCoarsestScaleHasThePreviewsAndTheOthersNameThem) {
  Mesh mesh = testing::bumpy_sphere(16, 24);
  mesh.part_names = {"body", "gone"};
  Case c(mesh);
  c.add_image(TextureRole::kBaseColour);
  c.materials[0].base_colour_texture = {
      0, 0, Wrap::kClamp, Wrap::kMirror, true, Minification::kNearest, {{0.5f, 0}, {2, 3}, 0}};
  const ScaleFiles files = c.write(MeshCodec::kDraco);
  ASSERT_GT(files.files.size(), 2u);
  const Glb last = open(files.files.back().glb);
  EXPECT_EQ(view_bytes(last, last.json["images"][0]["bufferView"]), c.previews.planes[0].file);
  EXPECT_FALSE(last.json["images"][0].contains("uri"));
  for (const ScaleFile& file : files.files) {
    const Glb glb = open(file.glb);
    for (const char* same : {"materials", "textures", "samplers"})
      EXPECT_EQ(glb.json[same], last.json[same]) << same;
    ASSERT_EQ(glb.json["nodes"].size(), 2u);  // a node per part, whatever is left of it
    EXPECT_EQ(glb.json["nodes"][0]["name"], "body");
    EXPECT_EQ(glb.json["nodes"][1]["name"], "gone");
    EXPECT_FALSE(glb.json["nodes"][1].contains("mesh"));
    if (&file == &files.files.back()) continue;
    EXPECT_EQ(glb.json["images"], Json::parse(R"([{"name":"texture/0","mimeType":"image/jpeg",
                                                 "uri":"../preview/000.jpg"}])"));
  }
}

}  // namespace texmesh::scale_materials_test
