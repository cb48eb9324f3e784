#include "stages/geometry/mesh_topology.h"

#include <gtest/gtest.h>

namespace texmesh::component_boxes_test {

TEST(ComponentBoxes, HoldThePositionsOfTheirComponent) {
  const std::vector<Box3f> boxes = component_boxes({2, 0, 2}, {{1, 2, 3}, {-1, 0, 1}, {3, 0, 3}});
  ASSERT_EQ(boxes.size(), 3u);
  EXPECT_EQ(boxes[0].min, (Vec3f{-1, 0, 1}));
  EXPECT_TRUE(boxes[1].empty());
  EXPECT_EQ(boxes[2].min, (Vec3f{1, 0, 3}));
  EXPECT_EQ(boxes[2].max, (Vec3f{3, 2, 3}));
}

}  // namespace texmesh::component_boxes_test
