#include "format/base/vec.h"

#include <gtest/gtest.h>

#include <vector>

namespace texmesh::box_test {

TEST(Box3, IsEmptyUntilItHoldsAPoint) {
  Box3d box;
  EXPECT_TRUE(box.empty());
  EXPECT_EQ(box.size(), (Vec3d{}));
  EXPECT_EQ(box.diagonal(), 0);
  box.extend(Box3d{});
  EXPECT_TRUE(box.empty());
  box.extend(Vec3d{1, -2, 3});
  EXPECT_FALSE(box.empty());
  EXPECT_EQ(box.min, box.max);
  EXPECT_EQ(box.diagonal(), 0);
}

TEST(Box3, HoldsPointsAndBoxes) {
  const std::vector<Vec3f> points{{1, 0, 2}, {4, -4, 2}, {2, 0, 14}};
  const Box3f box = bounding_box(points);
  EXPECT_EQ(box.min, (Vec3f{1, -4, 2}));
  EXPECT_EQ(box.max, (Vec3f{4, 0, 14}));
  EXPECT_EQ(box.size(), (Vec3f{3, 4, 12}));
  EXPECT_EQ(box.diagonal(), 13);
  EXPECT_EQ(box.longest_side(), 12);
  EXPECT_EQ(box.longest_axis(), 2);
  EXPECT_EQ(box.centre(), (Vec3f{2.5, -2, 8}));
  Box3d larger = to_double(box);
  larger.extend(Box3d{{5, -1, 3}, {6, -1, 3}});
  EXPECT_EQ(larger.max, (Vec3d{6, 0, 14}));
  EXPECT_EQ((Box3f{{0, 0, 0}, {2, 2, 1}}).longest_axis(), 0) << "of equal sides the first";
}

TEST(BoundingSphere, StandsAroundTheMiddleOfTheBox) {
  const std::vector<Vec3f> points{{0, 0, 0}, {2, 0, 0}, {1, 0.5f, 0}};
  const BoundingSphere sphere = bounding_sphere(points);
  EXPECT_EQ(sphere.centre, (Vec3d{1, 0.25, 0}));
  EXPECT_EQ(sphere.radius, length(Vec3d{1, 0.25, 0}));
}

}  // namespace texmesh::box_test
