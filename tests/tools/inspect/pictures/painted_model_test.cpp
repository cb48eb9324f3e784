#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <sstream>

#include "format/base/errors.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/command.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"
#include "tests/support/zip_writer.h"
#include "tests/tools/inspect/pictures/painted_pictures.h"
#include "tools/inspect/package_mesh.h"
#include "tools/inspect/pictures/painted_model.h"

namespace texmesh::painted_model_test {

using namespace testing;  // NOLINT: of painted pictures

const RunContext kOneThread{};

ScaleMap map_of(const ConditionedMesh& mesh) {
  ScaleMap map;
  map.scales = 8;
  map.sigma.assign(9, 0.001f);
  map.convergence.assign(9, 1);
  map.crossings_at.assign(9, 3);
  for (Vec3f p : mesh.mesh.positions) map.persistence.push_back(p.y > 0.3f ? 8 : 0);
  return map;
}

TEST(PaintedColours, BrightnessRises) {
  double last = -1;
  for (int k = 0; k <= 100; ++k) {
    const Srgb c = colour_of(k / 100.0);
    const double light = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
    EXPECT_GE(light, last - 1) << k;
    last = light;
  }
  EXPECT_EQ(colour_of(-5), colour_of(0));
  EXPECT_EQ(colour_of(7), colour_of(1));
}

TEST(PaintedModel, ScalesPaintEveryVertex) {
  const ConditionedMesh mesh = ball();
  const PaintedModel view = paint_scales(mesh, map_of(mesh));
  ASSERT_EQ(view.mesh.colours.size(), mesh.mesh.wedge_count());
  EXPECT_EQ(view.legend.lo, 0);
  EXPECT_EQ(view.legend.hi, 8);
  ASSERT_EQ(view.legend.stops.size(), 5u);
  EXPECT_EQ(view.legend.stops[2].value, 4);
  for (std::size_t w = 0; w < mesh.mesh.wedge_count(); ++w) {
    const bool high = mesh.mesh.positions[mesh.mesh.wedge_position[w]].y > 0.3f;
    EXPECT_EQ(view.mesh.colours[w].x > 0.9f, high);  // yellow, dark violet
  }
  EXPECT_EQ(faults(write_painted_glb(view)), "");
  const Pixels picture = picture_of(view);
  EXPECT_EQ(picture.width_px, 2 * 64 + 16u);
  EXPECT_EQ(picture.height_px, 64u);
  EXPECT_GT(count_near(picture, colour_of(1)), 50);
  EXPECT_THROW(paint_scales(mesh, {}), StageError);
}

TEST(PaintedModel, TheScaleMapIsDataToo) {
  ConditionedMesh mesh = ball();
  mesh.mesh.origin = {100, 0, 0};
  const ScaleMap map = map_of(mesh);
  const PaintedModel view = paint_scales(mesh, map);
  std::istringstream csv(write_painted_csv(view, "scale")), ply(write_painted_ply(view, "scale"));
  std::string line;
  std::getline(csv, line);
  EXPECT_EQ(line, "scale,tx,ty,gx,gy,gz");
  while (std::getline(ply, line) && line != "end_header") {
    if (line.starts_with("element"))
      EXPECT_EQ(line, fmt::format("element vertex {}", map.persistence.size()));
  }
  for (std::size_t p = 0; p < map.persistence.size(); ++p) {
    const Vec3d at = to_double(mesh.mesh.positions[p]) + mesh.mesh.origin;
    const PaintedPoint& point = view.points[p];
    std::getline(csv, line);
    EXPECT_EQ(line, fmt::format("{},{},{},{},{},{}", map.persistence[p], point.texture.x, point.texture.y,
                                at.x, at.y, at.z));
    std::getline(ply, line);
    EXPECT_EQ(line, fmt::format("{} {} {} {} {} {}", at.x, at.y, at.z, point.texture.x, point.texture.y,
                                map.persistence[p]));
  }
  EXPECT_FALSE(std::getline(csv, line)) << line;
  EXPECT_FALSE(std::getline(ply, line)) << line;
  ASSERT_EQ(view.legend.remarks.size(), 10u) << "a line for each scale";
  EXPECT_TRUE(view.legend.remarks[8].starts_with("S_8: sigma 0.001, ")) << view.legend.remarks[8];
  EXPECT_THROW(write_painted_csv({}, "atlas"), InputError) << "textures have no values of vertices";
}

TEST(PaintedModel, FeaturesArePaintedToHalfTheDistanceThatTheyKeep) {
  const ConditionedMesh mesh = condition_mesh(testing::sphere(120, 180), false, {}, kOneThread);
  ScaleMap map = map_of(mesh);
  std::uint32_t feature = 0;
  for (std::uint32_t p = 0; p < map.persistence.size(); ++p)
    if (mesh.mesh.positions[p].x > mesh.mesh.positions[feature].x) feature = p;
  map.persistence.assign(map.persistence.size(), 0);
  map.persistence[feature] = 8;
  std::size_t alone = 0, near = 0;
  for (const float sigma : {0.001f, 100.0f}) {  // the second one is held at the component's largest
    map.sigma.assign(9, sigma);
    const PaintedModel view = paint_scales(mesh, map);
    for (std::size_t w = 0; w < mesh.mesh.wedge_count(); ++w) {
      if (view.mesh.colours[w].x < 0.9f) continue;
      const Vec3f p = mesh.mesh.positions[mesh.mesh.wedge_position[w]];
      EXPECT_LT(length(p - mesh.mesh.positions[feature]), sigma < 1 ? 1e-6f : 0.05f);
      ++(sigma < 1 ? alone : near);
    }
  }
  EXPECT_GE(alone, 1u);
  EXPECT_GT(near, 3 * alone);
}

Fragments fragments_of(std::uint32_t side) {
  TexturePlane plane;
  plane.width_px = plane.height_px = side;
  plane.fragment_width_px = plane.fragment_height_px = side / 2;
  plane.columns = plane.rows = 2;
  plane.covered_texels = {1, 1, 1, 0};
  plane.eta = {0, 1, 0.5f, 0, /* scale 1: */ 0, 0, 0, 0};
  return {1, {plane}, {}};
}

TEST(PaintedModel, FragmentsArePaintedOverTheTexture) {
  const ConditionedMesh mesh = condition_mesh(testing::sheet(4), false, {}, kOneThread);
  std::vector<Material> materials(1);
  materials[0].base_colour_texture.image = 0;
  const Bytes jpeg =
      encode_jpeg(Pixels{64, 64, 3, std::vector<std::uint8_t>(64 * 64 * 3, 255)}, 95, Subsampling::k444);
  const std::vector<Image> images{probe_image("white.jpg", jpeg, {})};
  const PaintedModel view = paint_fragments(mesh, materials, images, fragments_of(64));
  ASSERT_EQ(view.textures.size(), 1u);
  const Pixels& p = view.textures[0];
  const auto colour_at = [&](std::uint32_t x, std::uint32_t y) {
    return Srgb{p.at(x, y)[0], p.at(x, y)[1], p.at(x, y)[2]};
  };
  EXPECT_EQ(colour_at(10, 10), colour_of(0));
  EXPECT_EQ(colour_at(50, 10), colour_of(1));
  EXPECT_EQ(colour_at(10, 50), colour_of(0.5));
  EXPECT_EQ(colour_at(50, 50), (Srgb{128, 128, 128}));
  EXPECT_EQ(colour_at(32, 10), (Srgb{0, 0, 0}));  // the grid's line
  EXPECT_EQ(faults(write_painted_glb(view)), "");
  EXPECT_GT(count_near(picture_of(view), colour_of(1)), 20);
  EXPECT_THROW(paint_fragments(mesh, {Material{}}, {}, {}), InputError);
}

TEST(PaintedModel, APackageShowsItsFragmentsAndNamesTheAlternative) {
  testing::TemporaryFolder folder;
  const Bytes package = testing::make_package_parts().build();
  testing::write_text(folder / "p.texmesh", {package.begin(), package.end()});
  EXPECT_TRUE(is_package(folder / "p.texmesh"));
  EXPECT_FALSE(is_package(TEXMESH_SOURCE_DIR "/README.md"));
  EXPECT_FALSE(is_package(folder / "absent"));
  const Bytes model = testing::zip_of({{"a.obj", "v 0 0 0\n"}});
  testing::write_text(folder / "a.zip", {model.begin(), model.end()});
  EXPECT_FALSE(is_package(folder / "a.zip")) << "another ZIP archive may hold a model";
  const std::span<const PaintedQuantity> all = painted_quantities();
  ASSERT_EQ(all[1].name, "fragments");
  const PaintedModel view = paint_package(folder / "p.texmesh", all[1], kOneThread);
  ASSERT_EQ(view.textures.size(), 1u);
  EXPECT_EQ(view.textures[0].width_px, 64u);
  EXPECT_EQ(faults(write_painted_glb(view)), "");
  try {
    paint_package(folder / "p.texmesh", all[2], kOneThread);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("the model it was compiled from"), std::string::npos);
  }
}

}  // namespace texmesh::painted_model_test
