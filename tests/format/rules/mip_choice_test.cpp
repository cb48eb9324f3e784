#include "format/rules/viewing.h"

#include <gtest/gtest.h>

namespace texmesh::mip_choice_test {

TEST(MipChoice, LevelOfADisplay) {
  PlaneTables t;
  t.columns = 2, t.rows = 1;
  t.covered_texels = {3000000, 1194304};  // 2048 x 2048
  t.surface_fraction = {0.5f, 0.5f};
  // A surface of 4 in a height of 2: 1024 texels per unit; at 1024 px the height has 512 px per unit.
  EXPECT_NEAR(display_level(t, 4, 2, 1024), 1, 1e-12);
  EXPECT_NEAR(display_level(t, 4, 2, 2048), 0, 1e-12);
  EXPECT_NEAR(display_level(t, 4, 2, 4096), -1, 1e-12);
  EXPECT_EQ(display_level(t, 0, 2, 1024), 0);
  t.covered_texels = {0, 0};
  EXPECT_EQ(display_level(t, 4, 2, 1024), 0);
}

TEST(MipChoice, PlaneWithTheLargestMipWithinALevel) {
  std::vector<TextureInfo> textures(5);
  for (std::uint32_t p = 0; p < 5; ++p) textures[p].base = p == 1 ? 1 : 0;
  textures[2].mip = 1, textures[3].mip = 2, textures[4].mip = 3;
  EXPECT_EQ(plane_at_level(textures, 0, -1), 0u);
  EXPECT_EQ(plane_at_level(textures, 0, 0.9), 0u);
  EXPECT_EQ(plane_at_level(textures, 0, 1), 2u);
  EXPECT_EQ(plane_at_level(textures, 0, 2.9), 3u);
  EXPECT_EQ(plane_at_level(textures, 0, 50), 4u);
  EXPECT_EQ(plane_at_level(textures, 1, 50), 1u) << "a texture without mips";
}

}  // namespace texmesh::mip_choice_test
