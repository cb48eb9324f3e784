#include "tools/inspect/atlas/atlas_report.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "stages/image/png_writer.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"

namespace texmesh::testing::atlas_report_test {

using Json = nlohmann::ordered_json;

Image png(std::uint32_t side, std::uint8_t grey) {
  Pixels p{side, side, 3, {}};
  p.data.assign(std::size_t{side} * side * 3, grey);
  Image image;
  image.name = "colour.png";
  image.bytes = write_png(p);
  image.width_px = image.height_px = side;
  image.channels = 3, image.bits_per_channel = 8;
  return image;
}

Model model_of(Mesh mesh, bool textured = true) {
  Model model;
  model.mesh = std::move(mesh);
  model.materials.resize(1);
  if (textured) {
    model.materials[0].base_colour_texture.image = 0;
    model.images.push_back(png(128, 90));
  }
  return model;
}

AtlasDiagnosis diagnosis_of(Model model) { return diagnose_atlases(atlas_subject(std::move(model), {}), {}); }

bool advises(const AtlasDiagnosis& d, const std::string& code) {
  return std::ranges::any_of(d.advice, [&](const AtlasAdvice& a) { return a.code == code; });
}

TEST(AtlasReport, ASoundAtlasNeedsNothing) {
  const AtlasDiagnosis d = diagnosis_of(model_of(sheet(12, 0)));
  EXPECT_TRUE(d.nothing.empty());
  EXPECT_TRUE(d.advice.empty());
  const std::string text = atlas_text(d);
  EXPECT_NE(text.find("texture 0 (colour.png), 128 x 128 px, material 0\n"), std::string::npos) << text;
  EXPECT_NE(text.find("nothing to do: the atlas is sound\n"), std::string::npos) << text;
}

TEST(AtlasReport, AdviceNamesTheTextureAndTheRemedy) {
  Mesh mesh = sheet(40, 0);
  for (std::size_t w = 0; w < mesh.uv0.size(); ++w)  // a tenth of the height
    mesh.uv0[w].y *= 0.1f;
  const AtlasDiagnosis d = diagnosis_of(model_of(mesh));
  EXPECT_TRUE(advises(d, "cover"));
  EXPECT_TRUE(advises(d, "stretch"));
  EXPECT_FALSE(advises(d, "overlap"));
  EXPECT_FALSE(advises(d, "seams"));
  EXPECT_EQ(d.advice[0].atlas, "texture 0 (colour.png)");
  const std::string text = atlas_text(d);
  EXPECT_NE(text.find("- texture 0 (colour.png): Only 10 % of the texels are shown."), std::string::npos)
      << text;
}

TEST(AtlasReport, LargeFiguresAreWholeNumbers) {
  Mesh mesh = sheet(40, 0);
  for (Vec2f& uv : mesh.uv0) uv.y *= 0.004f;
  const AtlasDiagnosis d = diagnosis_of(model_of(mesh));
  ASSERT_TRUE(advises(d, "stretch"));
  for (const AtlasAdvice& a : d.advice) EXPECT_EQ(a.found.find("e+"), std::string::npos) << a.found;
}

TEST(AtlasReport, EveryTriangleAChartIsTooMany) {
  const Mesh whole = sheet(30, 0);
  Mesh torn = whole;
  torn.wedge_position.clear(), torn.uv0.clear(), torn.normals.clear();
  float shift = 0;
  for (Triangle& t : torn.triangles) {
    shift += 1e-4f;  // no two triangles meet in the texture
    for (std::uint32_t& w : t) {
      torn.wedge_position.push_back(whole.wedge_position[w]);
      torn.uv0.push_back({whole.uv0[w].x, whole.uv0[w].y + shift});
      w = static_cast<std::uint32_t>(torn.uv0.size() - 1);
    }
  }
  const AtlasDiagnosis d = diagnosis_of(model_of(torn));
  EXPECT_EQ(d.charts(), torn.triangles.size());
  EXPECT_GE(d.triangle_floor(), d.charts());
  EXPECT_EQ(d.floor_bytes(), 8 * d.triangle_floor());
  ASSERT_TRUE(advises(d, "charts"));
  EXPECT_EQ(d.advice[0].code, "charts");
  EXPECT_NE(d.advice[0].remedy.find("--atlas auto"), std::string::npos) << d.advice[0].remedy;
  EXPECT_TRUE(advises(d, "thin"));
}

TEST(AtlasReport, ModelsWithoutAnAtlasGetASentence) {
  const AtlasDiagnosis plain = diagnosis_of(model_of(cube(), false));
  EXPECT_EQ(atlas_text(plain), "No material has a texture, so there is no atlas to look at.\n");
  EXPECT_EQ(to_json(plain)["atlases"], Json::array());
  Mesh mesh = cube();
  mesh.uv0.clear();
  const AtlasDiagnosis bare = diagnosis_of(model_of(mesh));
  EXPECT_NE(bare.nothing.find("no texture coordinates"), std::string::npos);
  EXPECT_EQ(bare.untextured_triangles, 12u);
}

TEST(AtlasReport, APackageHasTheFiguresOfItsFinestScale) {
  const Bytes bytes = make_package_parts().build();
  PackageReader package(open_container(memory_source(bytes)));
  const AtlasSubject subject = atlas_subject(package, {});
  ASSERT_EQ(subject.images.size(), 1u);
  EXPECT_EQ(subject.images[0].width_px, 64u);  // the texture's, not the preview's
  EXPECT_EQ(subject.images[0].height_px, 48u);
  ASSERT_TRUE(subject.images[0].colours);
  EXPECT_EQ(subject.images[0].colours->width_px, 64u);
  const Json j = to_json(diagnose_atlases(subject, {}));
  EXPECT_EQ(j["triangles"], fine_mesh().triangles.size());
  EXPECT_EQ(j["atlases"][0]["name"], "texture 0 (ball.jpg)");
}

}  // namespace texmesh::testing::atlas_report_test
