// Scales as glTF files: every codec, every attribute, all of them read back.
#include "pipeline/import/import_images.h"
#include "tests/stages/scales/scales_checks.h"

namespace texmesh::scales_test {

using namespace testing;  // NOLINT: fixtures and checks

TEST(Scales, EveryCodecKeepsASphereWithNormals) {
  const Case c(testing::bumpy_sphere(16, 24));
  ASSERT_GE(c.scales.scales.size(), 4u);
  for (MeshCodec codec : kCodecs) expect_round_trip(c, codec);
}

TEST(Scales, SeveralPartsMaterialsTextureSetsAndColours) {
  Mesh m = testing::bumpy_sphere(14, 20);
  for (std::size_t t = 0; t < m.triangles.size(); ++t) {
    m.triangle_material[t] = static_cast<std::uint16_t>(t < 200 ? 0 : 1);
    m.triangle_part[t] = static_cast<std::uint16_t>(t < 100 ? 0 : t < 300 ? 1 : 2);
  }
  m.part_names = {"top \"quoted\"", "middle", "bottom \xc3\xa4"};
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    m.uv1.push_back({m.uv0[w].y, m.uv0[w].x});
    const auto grey = static_cast<float>(w % 256) / 255;
    m.colours.push_back({grey, 0.5f, 1 - grey, 1});
  }
  Case c(m, 2);
  c.add_image(TextureRole::kBaseColour);
  c.add_image(TextureRole::kOcclusionRoughnessMetallic);
  c.materials[0].base_colour_texture.image = 0;
  c.materials[1].occlusion_texture = {
      1, 1, Wrap::kClamp, Wrap::kMirror, true, Minification::kNearest, {{0.25f, 0}, {2, 2}, 0.5f}};
  for (MeshCodec codec : kCodecs) {
    expect_round_trip(c, codec);
    const Glb glb = open(c.write(codec).files[0].glb);
    ASSERT_EQ(glb.json["nodes"].size(), 3u);
    EXPECT_EQ(glb.json["nodes"][0]["name"], m.part_names[0]);
    EXPECT_EQ(glb.json["nodes"][2]["name"], m.part_names[2]);
    EXPECT_EQ(glb.json["meshes"][1]["primitives"].size(), 2u);
    EXPECT_EQ(glb.json["asset"]["generator"], "texmesh");
  }
}

TEST(Scales, VeryManyPartsBecomeOneNode) {
  Mesh m = testing::bumpy_sphere(16, 24);
  m.part_names.clear();
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    m.triangle_part[t] = static_cast<std::uint16_t>(t % 257);
  for (int i = 0; i < 257; ++i) m.part_names.push_back("part " + std::to_string(i));
  const Case c(m, 1, 4);
  std::vector<std::size_t> want(257), got;
  for (std::uint16_t part : c.scales.mesh.triangle_part) ++want[part];
  for (MeshCodec codec : kCodecs) {
    expect_round_trip(c, codec);
    const ScaleFiles files = c.write(codec);
    const Glb glb = open(files.files[0].glb);
    EXPECT_EQ(glb.json["nodes"].size(), 1u);
    ASSERT_EQ(files.notes.size(), 1u);
    EXPECT_EQ(files.notes[0].code, "parts-merged");
    // The names are still there, and every triangle's vertices say whose it is.
    EXPECT_EQ(glb.json["meshes"][0]["extras"]["partNames"].get<std::vector<std::string>>(), m.part_names);
    const Json& ids = glb.json["meshes"][0]["primitives"][0]["extensions"]["EXT_mesh_features"]["featureIds"];
    EXPECT_EQ(ids[0]["featureCount"], 257);
    Vec3d translation;
    double step = 1;
    got.assign(257, 0);
    for (const Primitive& p : read(glb, translation, step))
      for (std::size_t i = 0; i < p.indices.size(); i += 3) {
        const float part = p.features[p.indices[i]][0];
        EXPECT_TRUE(part == p.features[p.indices[i + 1]][0] && part == p.features[p.indices[i + 2]][0]);
        ++got.at(static_cast<std::size_t>(part));
      }
    EXPECT_EQ(got, want);
    // A coarser scale names the parts that it still has.
    const NestedScale& coarsest = c.scales.scales.back();
    std::set<std::string> left, named;
    for (std::uint32_t t : coarsest.triangle_source)
      left.insert(m.part_names[c.scales.mesh.triangle_part[t]]);
    const Glb last = open(files.files.back().glb);
    for (const Json& name : last.json["meshes"][0]["extras"]["partNames"])
      named.insert(name.get<std::string>());
    EXPECT_LT(left.size(), 257u);
    EXPECT_EQ(named, left);
  }
}

TEST(Scales, MeshWithoutTextureCoordinates) {
  Mesh m = testing::bumpy_sphere(10, 14);
  m.uv0.clear(), m.normals.clear();
  Case c(m);
  c.add_image(TextureRole::kBaseColour);
  c.materials[0].base_colour_texture.image = 0;
  for (MeshCodec codec : kCodecs) {
    expect_round_trip(c, codec);
    const Glb glb = open(c.write(codec).files[0].glb);
    EXPECT_FALSE(glb.json["materials"][0]["pbrMetallicRoughness"].contains("baseColorTexture"));
  }
}

TEST(Scales, SingleTriangle) {
  Mesh m = testing::sheet(1, 0.1f);
  m.triangles.resize(1), m.triangle_material.resize(1), m.triangle_part.resize(1);
  const Case c(m);
  for (MeshCodec codec : kCodecs) expect_round_trip(c, codec);
}

TEST(Scales, MoreThan65535VerticesTakeWideIndices) {
  const Case c(testing::sheet(260, 0.05f), 1, 1);
  for (MeshCodec codec : kCodecs) {
    SCOPED_TRACE(std::string(enum_name(codec)));
    const ScaleFiles files = c.write(codec);
    const Glb glb = open(files.files[0].glb);
    EXPECT_EQ(glb.json["accessors"][glb.json["meshes"][0]["primitives"][0]["indices"].get<std::size_t>()]
                      ["componentType"],
              5125);
    Vec3d translation;
    double step = 1;
    const std::vector<Primitive> primitives = read(glb, translation, step);
    const Sums want = expected(c.scales.mesh, c.scales.scales[0]), got = found(primitives, step);
    EXPECT_EQ(got.triangles, want.triangles);
    EXPECT_NEAR(got.area, want.area, 0.01 * want.area);
    EXPECT_NEAR(got.uv_area, want.uv_area, 0.01 * std::fabs(want.uv_area));
  }
}

TEST(Scales, OnlyKeptScalesAreWritten) {
  Case c(testing::bumpy_sphere(16, 24));
  c.perceptual.kept.assign(c.scales.scales.size(), 0);
  c.perceptual.kept.back() = 1;
  const ScaleFiles files = c.write(MeshCodec::kDraco);
  ASSERT_EQ(files.files.size(), 2u);
  EXPECT_EQ(files.files[0].scale, 0);
  EXPECT_EQ(files.files[1].scale, c.scales.scales.back().scale);
  EXPECT_LT(files.files[1].glb.size(), files.files[0].glb.size() / 2);
}

TEST(Scales, SameBytesForAnyNumberOfThreads) {
  Case c(testing::bumpy_sphere(16, 24));
  c.add_image(TextureRole::kBaseColour, true);
  c.materials[0].base_colour_texture.image = 0;
  for (MeshCodec codec : kCodecs)
    EXPECT_EQ(encode_artefact(c.write(codec, {}, 1)), encode_artefact(c.write(codec, {}, 8)));
}

TEST(Scales, ProgressRisesWithWhatIsMade) {
  Case c(testing::bumpy_sphere(16, 24));
  ASSERT_GE(c.scales.scales.size(), 4u);
  for (const bool stream : {false, true}) {
    SCOPED_TRACE(stream);
    std::vector<double> told;
    RunContext context;
    context.progress = [&](double fraction) { told.push_back(fraction); };
    const ScaleFiles files = write_scales(c.scales, c.perceptual, c.materials, c.images, c.fragments,
                                          c.previews, {.stream = stream}, context);
    ASSERT_EQ(files.stream.empty(), !stream);
    // The stream, and each file that is made beside it.
    ASSERT_EQ(told.size(), stream ? 3u : 1 + c.scales.scales.size());
    EXPECT_GT(told.front(), 0);
    EXPECT_LE(told.back(), 1);
    EXPECT_TRUE(std::ranges::is_sorted(told, std::ranges::less_equal{}))
        << "each is more than the one before";
  }
}

}  // namespace texmesh::scales_test
