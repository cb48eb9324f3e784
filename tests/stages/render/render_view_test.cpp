// A whole view: camera, visibility and shading together.
#include <gtest/gtest.h>

#include "stages/render/shade.h"
#include "tests/support/meshes.h"

namespace texmesh::render_view_test {

RenderMaterial unlit() {
  RenderMaterial out;
  out.unlit = out.double_sided = true;
  return out;
}

Picture picture_of(const Mesh& mesh, const RenderMaterial& material,
                   const std::vector<RenderTexture>& textures, const ViewCamera& camera,
                   std::uint32_t side_px) {
  const std::vector<RenderMaterial> materials{material};
  const RenderScene scene = render_scene(mesh, materials, textures.size());
  return shade(scene, look(scene, perspective_camera(camera), side_px, {}), textures, studio_environment(),
               {});
}

/// The sheet of 1 x 1 from in front, with a texture.
Picture picture_of_sheet(Pixels pixels, Wrap wrap, std::uint32_t side_px) {
  const Mesh mesh = testing::sheet(1, 0);
  RenderMaterial material = unlit();
  TextureSlot& slot = material.slot(TextureUse::kBaseColour);
  slot.texture = 0;
  slot.wrap_s = slot.wrap_t = wrap;
  const ViewCamera camera{{1, 0, 0}, {0, 1, 0}, {0, 0, 1}, {0.5, 0.5, 0}, 0.75};
  return picture_of(mesh, material, {render_texture(std::move(pixels), true, 0, {})}, camera, side_px);
}

TEST(RenderView, ASphereCoversItsDiscWithoutHoles) {
  const Mesh mesh = testing::sphere(24, 48);
  for (int v = 0; v < 4; ++v) {
    const Picture picture = picture_of(mesh, unlit(), {}, camera_of(v, 4, {0, 0, 0}, 1), 100);
    std::size_t covered = 0;
    for (int y = 0; y < 100; ++y)
      for (int x = 0; x < 100; ++x) {
        const bool is_covered =
            picture.covered[static_cast<std::size_t>(y) * 100 + static_cast<std::size_t>(x)];
        covered += is_covered;
        if ((x - 49.5) * (x - 49.5) + (y - 49.5) * (y - 49.5) < 46.5 * 46.5) {
          EXPECT_TRUE(is_covered);
        }
      }
    EXPECT_NEAR(static_cast<double>(covered), 3.14159265 * 48 * 48, 300);
    EXPECT_NEAR(picture.linear[0].x, 0.2, 1e-6) << "the background";
  }
}

TEST(RenderView, TextureStandsTheRightWayUp) {
  const Pixels corners{2, 2, 3, {255, 0, 0, 0, 255, 0, 0, 0, 255, 255, 255, 255}};  // top row first
  const Picture picture = picture_of_sheet(corners, Wrap::kClamp, 60);
  const auto at = [&](std::size_t x, std::size_t y) { return picture.linear[y * 60 + x]; };
  EXPECT_GT(at(15, 15).x, 0.8);  // red: u = 0, v = 0, top left of the image, where y is high
  EXPECT_LT(at(15, 15).y, 0.2);
  EXPECT_GT(at(44, 15).y, 0.8);
  EXPECT_GT(at(15, 44).z, 0.8);
  EXPECT_GT(at(44, 44).x, 0.8);
}

TEST(RenderView, FinePatternsAreFilteredNotAliased) {
  // A checkerboard of single texels, seen at 1/16 of its size, is even grey.
  Pixels checkers{512, 512, 1, {}};
  for (std::uint32_t i = 0; i < 512 * 512; ++i)
    checkers.data.push_back((i + i / 512) % 2 ? std::uint8_t{255} : std::uint8_t{0});
  const Picture picture = picture_of_sheet(checkers, Wrap::kRepeat, 48);
  const float grey = tone_mapped({0.5f, 0.5f, 0.5f}).x;
  for (std::size_t i = 12; i < 36; ++i) EXPECT_NEAR(picture.linear[i * 48 + 24].x, grey, 0.01);
}

}  // namespace texmesh::render_view_test
