#include "stages/render/render_texture.h"

#include <gtest/gtest.h>

#include "tests/stages/render/render_fixtures.h"

namespace texmesh::shown_materials_test {

TexturePlane plane_of_size(std::uint32_t side_px, std::uint32_t mip, TextureRole role) {
  TexturePlane plane;
  plane.role = role;
  plane.mip = mip;
  plane.width_px = plane.height_px = side_px;
  plane.channels = role == TextureRole::kAlpha ? 1 : 3;
  return plane;
}

Pixels filled(const TexturePlane& plane, std::uint8_t value) {
  return {plane.width_px, plane.height_px, plane.channels,
          std::vector<std::uint8_t>(std::size_t{plane.width_px} * plane.height_px * plane.channels, value)};
}

struct Shown {
  Fragments fragments;
  std::vector<Pixels> pixels;
  std::vector<Material> materials{Material{}};
  ShownMaterials of(std::uint32_t least_side_px, const Mesh& mesh = testing::square()) const {
    return shown_materials(materials, fragments, pixels, mesh, least_side_px, {});
  }
  void add(const TexturePlane& plane, std::uint8_t value) {
    fragments.planes.push_back(plane);
    pixels.push_back(filled(plane, value));
  }
};

Shown with_mips() {
  Shown out;
  out.materials[0].base_colour_texture.image = 0;
  out.add(plane_of_size(64, 0, TextureRole::kBaseColour), 10);
  out.add(plane_of_size(64, 0, TextureRole::kAlpha), 200);
  out.add(plane_of_size(32, 1, TextureRole::kBaseColour), 20);
  out.add(plane_of_size(32, 1, TextureRole::kAlpha), 100);
  return out;
}

TEST(ShownMaterials, TakeTheCoarsestMipThatIsLargeEnough) {
  const Shown shown = with_mips();
  EXPECT_EQ(shown.of(100).textures.at(0).width_px, 64u) << "the full size, where all are too small";
  EXPECT_EQ(shown.of(40).textures.at(0).width_px, 64u);
  const ShownMaterials coarse = shown.of(32);
  EXPECT_EQ(coarse.textures.at(0).width_px, 32u);
  EXPECT_EQ(coarse.textures[0].levels[0].channels, 4u);
  EXPECT_EQ(coarse.textures[0].levels[0].data[0], 20);
  EXPECT_EQ(coarse.textures[0].levels[0].data[3], 100);
}

TEST(ShownMaterials, WithoutCoordinatesNothingShows) {
  Mesh mesh = testing::square();
  mesh.uv0.clear();
  const ShownMaterials out = with_mips().of(32, mesh);
  EXPECT_EQ(out.materials.at(0).slot(TextureUse::kBaseColour).texture, -1);
  EXPECT_TRUE(out.textures.empty());
}

TEST(ShownMaterials, OneImageAsColoursAndAsNumbersIsTwoTextures) {
  Shown shown = with_mips();
  shown.materials[0].normal_texture.image = 0;
  const ShownMaterials out = shown.of(64);
  ASSERT_EQ(out.textures.size(), 2u);
  EXPECT_NE(out.textures[0].srgb, out.textures[1].srgb);
}

TEST(ShownMaterials, PixelsThatDoNotFitTheirPlanesAreRefused) {
  Shown shown = with_mips();
  shown.pixels[0].height_px = 3;
  shown.pixels[0].data.resize(3 * 64 * 3);
  EXPECT_THROW(shown.of(64), StageError);
  shown.pixels.pop_back();
  EXPECT_THROW(shown.of(64), StageError);
}

}  // namespace texmesh::shown_materials_test
