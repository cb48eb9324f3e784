#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "stages/gltf/check_glb.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/command.h"
#include "tests/support/meshes.h"
#include "tests/support/packages.h"
#include "tools/inspect/debug/debug_input.h"

namespace texmesh {
namespace {

using nlohmann::json;

const RunContext kOneThread{};

ConditionedMesh ball() { return condition_mesh(testing::sphere(12, 18), false, {}, kOneThread); }

json json_of(const Bytes& glb) {
  std::uint32_t bytes = 0;
  std::memcpy(&bytes, glb.data() + 12, 4);
  return json::parse(glb.begin() + 20, glb.begin() + 20 + bytes);
}

std::string faults(const Bytes& glb) {
  Findings findings;
  check_glb(glb, "debug.glb", findings);
  std::string text;
  for (const Finding& f : findings.release()) text += to_string(f) + "\n";
  return text;
}

Pixels picture_of(const DebugView& view, std::uint32_t side = 64) {
  return decode_image(probe_image("debug.png", write_debug_png(view, side), {}));
}

/// How many pixels of the picture have about this colour.
int count_near(const Pixels& p, Srgb colour, int tolerance = 40) {
  int count = 0;
  for (std::uint32_t y = 0; y < p.height_px; ++y)
    for (std::uint32_t x = 0; x < 2 * p.height_px; ++x) {
      bool near = true;
      for (std::size_t k = 0; k < 3; ++k) near = near && std::abs(p.at(x, y)[k] - colour[k]) <= tolerance;
      count += near;
    }
  return count;
}

ScaleMap map_of(const ConditionedMesh& mesh) {
  ScaleMap map;
  map.scales = 8;
  map.sigma.assign(9, 0.001f);
  for (Vec3f p : mesh.mesh.positions) map.persistence.push_back(p.y > 0.3f ? 8 : 0);
  return map;
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

TEST(DebugColours, BrightnessRises) {
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

TEST(DebugView, PersistencePaintsEveryVertex) {
  const ConditionedMesh mesh = ball();
  const DebugView view = view_persistence(mesh, map_of(mesh));
  ASSERT_EQ(view.mesh.colours.size(), mesh.mesh.wedge_count());
  EXPECT_EQ(view.legend.lo, 0);
  EXPECT_EQ(view.legend.hi, 8);
  ASSERT_EQ(view.legend.stops.size(), 5u);
  EXPECT_EQ(view.legend.stops[2].first, 4);
  for (std::size_t w = 0; w < mesh.mesh.wedge_count(); ++w) {
    const bool high = mesh.mesh.positions[mesh.mesh.wedge_position[w]].y > 0.3f;
    EXPECT_EQ(view.mesh.colours[w].x > 0.9f, high);  // yellow, dark violet
  }
  EXPECT_EQ(faults(write_debug_glb(view)), "");
  const Pixels picture = picture_of(view);
  EXPECT_EQ(picture.width_px, 2 * 64 + 16u);
  EXPECT_EQ(picture.height_px, 64u);
  EXPECT_GT(count_near(picture, colour_of(1)), 50);
  EXPECT_THROW(view_persistence(mesh, {}), StageError);
}

TEST(DebugView, FeaturesArePaintedToHalfTheDistanceThatTheyKeep) {
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
    const DebugView view = view_persistence(mesh, map);
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

TEST(DebugView, SkeletonIsLines) {
  const ConditionedMesh mesh = ball();
  const DebugView view = view_skeleton(mesh, skeleton_of(mesh));
  EXPECT_FALSE(view.legend.coloured);
  EXPECT_EQ(view.legend.remarks.back(), "skeleton-test: made by hand");
  const Bytes glb = write_debug_glb(view);
  // A package's meshes are triangles only, and its check says so of lines; nothing else is wrong.
  EXPECT_EQ(faults(glb),
            "debug.glb: /meshes/1/primitives/0/mode: expected 4, triangles, found 1 [glb-reference]\n");
  const json root = json_of(glb);
  EXPECT_EQ(root["nodes"][1]["name"], "lines");
  const json primitive = root["meshes"][1]["primitives"][0];
  EXPECT_EQ(primitive["mode"], 1);
  EXPECT_EQ(root["accessors"][primitive["indices"].get<std::size_t>()]["count"], 4);
  EXPECT_EQ(root["materials"][0]["alphaMode"], "BLEND");
  const Pixels picture = picture_of(view);
  EXPECT_EQ(picture.width_px, 2 * 64u);
  EXPECT_GT(count_near(picture, {255, 40, 40}, 90), 20);  // the lines show through the ball
  EXPECT_THROW(view_radius(mesh, {}), StageError);
}

TEST(DebugView, RadiusNamesItsRangeAndFloor) {
  const ConditionedMesh mesh = ball();
  const DebugView view = view_radius(mesh, skeleton_of(mesh));
  EXPECT_GE(view.legend.lo, 0.1);
  EXPECT_LE(view.legend.hi, 1.1001);
  EXPECT_LT(view.legend.lo, view.legend.hi);
  EXPECT_EQ(faults(write_debug_glb(view)), "");
}

TEST(DebugView, CollapseErrorIsLogarithmicAndSurvivorsHaveTheHighestColour) {
  NestedScales scales;
  scales.mesh = testing::sphere(8, 12);
  scales.scales.resize(1);
  for (std::uint32_t p = 0; p < 40; ++p) scales.collapses.push_back({p, 50, 0.001f * static_cast<float>(p)});
  const DebugView view = view_collapse_error(scales);
  EXPECT_TRUE(view.legend.logarithmic);
  EXPECT_FLOAT_EQ(static_cast<float>(view.legend.hi), 0.039f);
  EXPECT_GT(view.legend.lo, 0);
  for (std::size_t w = 0; w < scales.mesh.wedge_count(); ++w) {
    if (scales.mesh.wedge_position[w] >= 40) EXPECT_GT(view.mesh.colours[w].x, 0.9f);
    if (scales.mesh.wedge_position[w] == 0) EXPECT_LT(view.mesh.colours[w].x, 0.1f);
  }
  EXPECT_EQ(faults(write_debug_glb(view)), "");
  scales.collapses.clear();  // nothing was removed: still a picture
  EXPECT_EQ(faults(write_debug_glb(view_collapse_error(scales))), "");
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

TEST(DebugView, FragmentsArePaintedOverTheTexture) {
  const ConditionedMesh mesh = condition_mesh(testing::sheet(4), false, {}, kOneThread);
  std::vector<Material> materials(1);
  materials[0].base_colour_texture.image = 0;
  const Bytes jpeg =
      encode_jpeg(Pixels{64, 64, 3, std::vector<std::uint8_t>(64 * 64 * 3, 255)}, 95, Subsampling::k444);
  const std::vector<Image> images{probe_image("white.jpg", jpeg, {})};
  const DebugView view = view_fragments(mesh, materials, images, fragments_of(64));
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
  EXPECT_EQ(faults(write_debug_glb(view)), "");
  EXPECT_GT(count_near(picture_of(view), colour_of(1)), 20);
  EXPECT_THROW(view_fragments(mesh, {Material{}}, {}, {}), InputError);
}

TEST(DebugView, APackageShowsItsFragmentsAndNamesTheAlternative) {
  testing::TemporaryFolder folder;
  const Bytes package = testing::make_package_parts().build();
  testing::write_text(folder / "p.texmesh", {package.begin(), package.end()});
  EXPECT_TRUE(is_package(folder / "p.texmesh"));
  EXPECT_FALSE(is_package(TEXMESH_SOURCE_DIR "/README.md"));
  EXPECT_FALSE(is_package(folder / "absent"));
  const DebugView view = view_package(folder / "p.texmesh", DebugQuantity::kFragments, kOneThread);
  ASSERT_EQ(view.textures.size(), 1u);
  EXPECT_EQ(view.textures[0].width_px, 64u);
  EXPECT_EQ(faults(write_debug_glb(view)), "");
  try {
    view_package(folder / "p.texmesh", DebugQuantity::kSkeleton, kOneThread);
    FAIL();
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("texmesh debug MODEL --what skeleton"), std::string::npos);
  }
}

}  // namespace
}  // namespace texmesh
