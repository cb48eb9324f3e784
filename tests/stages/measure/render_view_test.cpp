#include "stages/measure/render_view.h"

#include <gtest/gtest.h>

#include "tests/support/meshes.h"

namespace texmesh {
namespace {

TEST(RenderView, ASphereCoversItsDiscWithoutHoles) {
  const Mesh mesh = testing::sphere(24, 48);
  std::vector<std::uint32_t> source(mesh.triangles.size(), 0);
  const std::vector<Material> materials(1);
  ViewScene scene;
  scene.mesh = &mesh;
  scene.triangles = &mesh.triangles;
  scene.triangle_source = &source;
  scene.materials = &materials;
  scene.base_plane = scene.emissive_plane = {-1};
  for (int v = 0; v < 4; ++v) {
    const ViewBuffer view = look_at(scene, camera_of(v, 4, {0, 0, 0}, 1), 100);
    const double disc = 3.14159265 * 96 * 96;  // samples: radius 0.96 * 100
    EXPECT_NEAR(static_cast<double>(view.samples.size()), disc, 0.02 * disc);
    for (int y = 0; y < 100; ++y)
      for (int x = 0; x < 100; ++x)
        if ((x - 49.5) * (x - 49.5) + (y - 49.5) * (y - 49.5) < 46.5 * 46.5) {
          EXPECT_EQ(view.hits[static_cast<std::size_t>(y) * 100 + static_cast<std::size_t>(x)], 4);
        }
    const Picture picture = draw(view, {});
    EXPECT_NEAR(picture.linear[50 * 100 + 50].x, 1, 0.01) << "the middle faces the head-light";
    EXPECT_NEAR(picture.linear[0].x, 0.2, 1e-6);
  }
}

TEST(RenderView, TextureStandsTheRightWayUp) {
  Mesh mesh = testing::sheet(1, 0);
  std::vector<std::uint32_t> source(2, 0);
  std::vector<Material> materials(1);
  materials[0].base_colour_texture.image = 0;
  materials[0].base_colour_texture.wrap_s = materials[0].base_colour_texture.wrap_t = Wrap::kClamp;
  materials[0].unlit = true;
  ViewScene scene{&mesh, &mesh.triangles, &source, &materials, {0}, {-1}, {{2, 2}}};
  MipTexture texture;
  texture.width_px = texture.height_px = 2;
  texture.levels.push_back({2, 2, {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {1, 1, 1}}});  // top row first
  build_mips(texture);
  ASSERT_EQ(texture.levels.size(), 2u);
  EXPECT_EQ(texture.levels[1].texels[0], (Vec3f{0.5f, 0.5f, 0.5f}));
  ViewCamera camera;
  camera.x = {1, 0, 0};
  camera.y = {0, 1, 0};
  camera.z = {0, 0, 1};
  camera.centre = {0.5, 0.5, 0};
  camera.radius = 0.75;
  const Picture picture = draw(look_at(scene, camera, 60), {texture});
  auto at = [&](int x, int y) {
    return picture.linear[static_cast<std::size_t>(y) * 60 + static_cast<std::size_t>(x)];
  };
  EXPECT_GT(at(15, 15).x, 0.9);  // red: u = 0, v = 0, top left of the image, where y is high
  EXPECT_LT(at(15, 15).y, 0.1);
  EXPECT_GT(at(44, 15).y, 0.9);
  EXPECT_GT(at(15, 44).z, 0.9);
  EXPECT_GT(at(44, 44).x, 0.9);
}

TEST(RenderView, FinePatternsAreFilteredNotAliased) {
  // A checkerboard of single texels, seen at 1/16 of its size, is even grey.
  Mesh mesh = testing::sheet(1, 0);
  std::vector<std::uint32_t> source(2, 0);
  std::vector<Material> materials(1);
  materials[0].unlit = true;
  ViewScene scene{&mesh, &mesh.triangles, &source, &materials, {0}, {-1}, {{512, 512}}};
  MipTexture texture;
  texture.width_px = texture.height_px = 512;
  texture.levels.push_back({512, 512, {}});
  for (int i = 0; i < 512 * 512; ++i) {
    const float c = static_cast<float>((i + i / 512) % 2);
    texture.levels[0].texels.push_back({c, c, c});
  }
  build_mips(texture);
  ViewCamera camera{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5, 0.5, 0}, 0.75};
  const Picture picture = draw(look_at(scene, camera, 48), {texture});
  for (int i = 12; i < 36; ++i)
    EXPECT_NEAR(picture.linear[static_cast<std::size_t>(i) * 48 + 24].x, 0.5, 0.01);
}

}  // namespace
}  // namespace texmesh
