#include "stages/data/fragments.h"

#include <gtest/gtest.h>

namespace texmesh::fragments_test {

TEST(FragmentRectangle, IsClippedToThePlaneUnlessPadded) {
  TexturePlane plane;
  plane.width_px = 70;
  plane.height_px = 40;
  plane.fragment_width_px = 32;
  plane.fragment_height_px = 16;
  plane.columns = 3;
  plane.rows = 3;
  EXPECT_EQ(fragment_rectangle(plane, 0), (TexelRectangle{0, 0, 32, 16}));
  EXPECT_EQ(fragment_rectangle(plane, 4), (TexelRectangle{32, 16, 32, 16}));
  EXPECT_EQ(fragment_rectangle(plane, 5), (TexelRectangle{64, 16, 6, 16}));
  EXPECT_EQ(fragment_rectangle(plane, 8), (TexelRectangle{64, 32, 6, 8}));
  EXPECT_EQ(padded_fragment_rectangle(plane, 8), (TexelRectangle{64, 32, 32, 16}));
  EXPECT_EQ(fragment_rectangle(plane, 8).right_px(), plane.width_px);
  EXPECT_EQ(fragment_rectangle(plane, 8).bottom_px(), plane.height_px);
}

}  // namespace texmesh::fragments_test
