#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "lab/cli/commands.h"
#include "stages/condition/condition.h"
#include "stages/data/nested_scales.h"
#include "stages/data/scale_map.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "tests/tools/inspect/pictures/painted_pictures.h"

namespace texmesh::picture_quantities_test {

using nlohmann::json;
using namespace testing;  // NOLINT: of painted pictures

json json_of(const Bytes& glb) {
  std::uint32_t bytes = 0;
  std::memcpy(&bytes, glb.data() + 12, 4);
  return json::parse(glb.begin() + 20, glb.begin() + 20 + bytes);
}

Skeleton skeleton_of(const ConditionedMesh& mesh) {
  Skeleton s;
  s.nodes = {{0, -0.5f, 0}, {0, 0.5f, 0}, {0.2f, 0, 0}};
  s.segments = {{0, 1}, {2, 2}};
  for (Vec3f p : mesh.mesh.positions)
    s.distance.push_back(std::fabs(p.y)), s.radius.push_back(0.1f + p.y * p.y);
  add_warning(s.notes, "skeleton-test", "", "made by hand");
  return s;
}

TEST(PictureQuantities, SkeletonIsLines) {
  const ConditionedMesh mesh = ball();
  const PaintedModel view = paint_skeleton(mesh, skeleton_of(mesh));
  EXPECT_FALSE(view.legend.coloured);
  EXPECT_EQ(view.legend.remarks.back(), "skeleton-test: made by hand");
  const Bytes glb = write_painted_glb(view);
  // A package's meshes are triangles only, and its check says so of lines; nothing else is wrong.
  EXPECT_EQ(faults(glb),
            "painted.glb: /meshes/1/primitives/0/mode: expected 4, triangles, found 1 [glb-reference]\n");
  const json root = json_of(glb);
  EXPECT_EQ(root["nodes"][1]["name"], "lines");
  const json primitive = root["meshes"][1]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 1);
  EXPECT_EQ(root["accessors"][primitive["indices"].get<std::size_t>()]["count"], 4);
  EXPECT_EQ(root["materials"][0]["alphaMode"], "BLEND");
  const Pixels picture = picture_of(view, 256);
  const std::uint32_t height = picture.height_px;
  EXPECT_EQ(picture.width_px, 2 * height);
  // A line of half the ball's height from both sides: it shows through the ball, which dulls its red.
  int rows = 0;
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t side = 0; side < 2; ++side) {
      int redder = 0;
      for (std::uint32_t x = 0; x < height; ++x) {
        const std::uint8_t* c = picture.at(height * side + x, y);
        redder = std::max(redder, c[0] - c[1]);
      }
      rows += redder > 60;
    }
  EXPECT_GE(rows, 200);
  EXPECT_THROW(paint_radius(mesh, {}), StageError);
}

TEST(PictureQuantities, RadiusNamesItsRangeAndFloor) {
  const ConditionedMesh mesh = ball();
  const PaintedModel view = paint_radius(mesh, skeleton_of(mesh));
  EXPECT_GE(view.legend.lo, 0.1);
  EXPECT_LE(view.legend.hi, 1.1001);
  EXPECT_LT(view.legend.lo, view.legend.hi);
  EXPECT_EQ(faults(write_painted_glb(view)), "");
}

TEST(PictureQuantities, EveryCollapseHasItsPerceptualValue) {
  NestedScales scales;
  scales.mesh = testing::sphere(8, 12);
  scales.collapses = {{3, 5, 0}, {4, 4, 0}};  // the second one vanishes with its component
  Skeleton skeleton;
  skeleton.distance.assign(scales.mesh.positions.size(), 1);
  skeleton.radius.assign(scales.mesh.positions.size(), 2);
  skeleton.distance[3] = 1.5f;
  const PaintedModel view = paint_perceptual(scales, skeleton);
  for (std::size_t p = 0; p < view.points.size(); ++p)
    EXPECT_EQ(view.points[p].value, p == 3 ? 0.25 : 0) << p;
}

TEST(PictureQuantities, CollapseErrorIsLogarithmicAndSurvivorsHaveTheHighestColour) {
  NestedScales scales;
  scales.mesh = testing::sphere(8, 12);
  scales.scales.resize(1);
  for (std::uint32_t p = 0; p < 40; ++p) scales.collapses.push_back({p, 50, 0.001f * static_cast<float>(p)});
  const PaintedModel view = paint_collapse_error(scales);
  EXPECT_TRUE(view.legend.logarithmic);
  EXPECT_FLOAT_EQ(static_cast<float>(view.legend.hi), 0.039f);
  EXPECT_GT(view.legend.lo, 0);
  for (std::size_t w = 0; w < scales.mesh.wedge_count(); ++w) {
    if (scales.mesh.wedge_position[w] >= 40) EXPECT_GT(view.mesh.colours[w].x, 0.9f);
    if (scales.mesh.wedge_position[w] == 0) EXPECT_LT(view.mesh.colours[w].x, 0.1f);
  }
  EXPECT_EQ(faults(write_painted_glb(view)), "");
  scales.collapses.clear();  // nothing was removed: still a picture
  EXPECT_EQ(faults(write_painted_glb(paint_collapse_error(scales))), "");
}

}  // namespace texmesh::picture_quantities_test
