// The pictures behind extract --bytes: views of a mesh, their windows, and differences between them.
#include "tools/extract/budget/reference.h"

#include <gtest/gtest.h>

#include <set>

#include "tests/support/meshes.h"

namespace texmesh::lit_meter_test {

constexpr std::uint32_t kSide = 96;

LitMesh sphere(int rings, bool flat_map) {
  LitMesh out;
  out.mesh = testing::bumpy_sphere(rings, 2 * rings);
  RenderMaterial material;
  material.metallic = 0;
  material.roughness = 0.5f;
  if (flat_map) material.slot(TextureUse::kNormal).texture = 0;
  out.materials.assign(1, material);
  out.texture_count = 1;
  return out;
}

RenderTexture normals(std::uint8_t x) { return render_texture({1, 1, 3, {x, 128, 230}}, false, 0, {}); }

std::vector<LitCamera> cameras_of(const LitMesh& mesh) {
  return cameras_around(bounding_sphere(mesh.mesh.positions), 3, kSide);
}

TEST(LitMeter, EqualPicturesDoNotDifferAndOtherNormalsDo) {
  const LitMesh mesh = sphere(12, true);
  const LitViews views(mesh, cameras_of(mesh), {});
  const RenderEnvironment environment = studio_environment();
  const LitMeter meter(views, {normals(128)}, environment, {});
  EXPECT_EQ(meter.difference(views, {normals(128)}, {}), 0);
  const double little = meter.difference(views, {normals(150)}, {}),
               much = meter.difference(views, {normals(200)}, {});
  EXPECT_GT(little, 0.001);
  EXPECT_GT(much, little);
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(meter.difference(views, {normals(200)}, eight), much);
}

TEST(LitMeter, CoarserMeshesDiffer) {
  const LitMesh fine = sphere(24, false), coarse = sphere(8, false);
  const std::vector<LitCamera> cameras = cameras_of(fine);
  const LitViews views(fine, cameras, {}), coarser(coarse, cameras, {});
  const RenderEnvironment environment = studio_environment();
  const LitMeter meter(views, {RenderTexture{}}, environment, {});
  EXPECT_GT(meter.difference(coarser, {RenderTexture{}}, {}), 0.001);
}

TEST(Windows, ShowThePartOfThePictureThatTheyStandFor) {
  const LitMesh mesh = sphere(12, false);
  const std::vector<LitCamera> cameras = cameras_of(mesh);
  const LitViews views(mesh, cameras, {});
  const std::vector<LitCamera> windows = windows_of(views, kSide, 2, 32);
  ASSERT_EQ(windows.size(), 2 * cameras.size());
  const LitViews parts(mesh, windows, {});
  for (std::size_t w = 0; w < windows.size(); ++w) {
    const RenderCamera &whole = cameras[w / 2].camera, &part = windows[w].camera;
    EXPECT_EQ(part.eye, whole.eye);
    EXPECT_NEAR(part.tan_half_fov / windows[w].side_px, whole.tan_half_fov / kSide, 1e-12);
    EXPECT_GT(parts.covered_px(w), 32u * 32u / 5);
  }
}

TEST(Bands, OfAQuarterOfTheRowsTellAboutWhatAllTell) {
  constexpr std::uint32_t kLargeSide = 512;
  const LitMesh mesh = sphere(12, true);
  std::vector<LitCamera> cameras = cameras_around(bounding_sphere(mesh.mesh.positions), 3, kLargeSide);
  const LitViews small(mesh, cameras_of(mesh), {}), whole(mesh, cameras, {});
  std::set<std::vector<std::uint8_t>> parts;
  for (std::size_t v = 0; v < cameras.size(); ++v) {
    cameras[v].bands = bands_of(small, v, kLargeSide);
    EXPECT_EQ(std::ranges::count(cameras[v].bands, 1), 4);
    parts.insert(cameras[v].bands);
    EXPECT_TRUE(bands_of(small, v, kSide).empty());
  }
  EXPECT_GT(parts.size(), 1u);
  const LitViews some(mesh, cameras, {});
  const RenderEnvironment environment = studio_environment();
  const double all = LitMeter(whole, {normals(128)}, environment, {}).difference(whole, {normals(200)}, {}),
               part = LitMeter(some, {normals(128)}, environment, {}).difference(some, {normals(200)}, {});
  EXPECT_NEAR(part, all, 0.2 * all);
  EXPECT_NE(part, all);
}

}  // namespace texmesh::lit_meter_test
