#include "stages/charts/chart_parts.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::flat_chart_test {

TEST(FlatChart, AxesAreRightHandedForEveryNormal) {
  for (const Vec3d n : {Vec3d{1, 0, 0}, Vec3d{0, -1, 0}, Vec3d{0, 0, 1}, normalized(Vec3d{1, -2, 3})}) {
    const PlaneAxes axes(n);
    EXPECT_NEAR(length(axes.x), 1, 1e-12);
    EXPECT_NEAR(length(cross(axes.x, axes.y) - n), 0, 1e-12);
  }
}

TEST(FlatChart, StretchOfKnownMaps) {
  const OwnPlane own(std::array<Vec3d, 3>{Vec3d{1, 1, 1}, Vec3d{3, 1, 1}, Vec3d{2, 1, 5}});
  EXPECT_NEAR(own.area(), 4, 1e-12);
  const Vec2d same[3] = {{0, 0}, {2, 0}, {1, 4}}, wide[3] = {{0, 0}, {6, 0}, {3, 4}},
              flipped[3] = {{0, 0}, {2, 0}, {1, -4}}, turned[3] = {{0, 0}, {0, 2}, {-4, 1}};
  EXPECT_NEAR(flat_stretch(own, same).largest2, 1, 1e-12);
  EXPECT_NEAR(flat_stretch(own, turned).least2, 1, 1e-12);
  EXPECT_NEAR(flat_stretch(own, turned).area, 4, 1e-12);
  EXPECT_NEAR(flat_stretch(own, wide).largest2, 9, 1e-12);
  EXPECT_NEAR(flat_stretch(own, wide).least2, 1, 1e-12);
  EXPECT_NEAR(flat_stretch(own, flipped).area, -4, 1e-12);
}

TEST(FlatChart, ABorderThatCrossesItselfIsFound) {
  // A ring of four triangles around no corner of their own: a fan whose rim is the border.
  const std::vector<std::uint32_t> vertices{0, 1, 2, 0, 2, 3, 0, 3, 4, 0, 4, 1};
  const std::vector<std::uint32_t> rim{1, 4, 7, 10};
  const auto places = [](std::array<Vec2d, 5> p) {
    return std::vector<Vec2d>{p[0], p[1], p[2], p[0], p[2], p[3], p[0], p[3], p[4], p[0], p[4], p[1]};
  };
  EXPECT_TRUE(border_is_simple(rim, vertices, places({{{0, 0}, {1, 0}, {0, 1}, {-1, 0}, {0, -1}}})));
  EXPECT_FALSE(border_is_simple(rim, vertices, places({{{0, 0}, {1, 0}, {-1, 0}, {0, 1}, {0, -1}}})));
}

TEST(FlatChart, SmallestBoxOfATurnedRectangle) {
  const Vec2d side = {0.8, 0.6};
  std::vector<Vec2d> points;
  for (const auto& [a, b] : {std::pair{0.0, 0.0}, {3.0, 0.0}, {3.0, 1.0}, {0.0, 1.0}, {1.0, 0.5}})
    points.push_back({5 + a * side.x - b * side.y, a * side.y + b * side.x});
  const Vec2d found = smallest_box_side(points);
  EXPECT_NEAR(std::fabs(dot(found, side)) * std::fabs(cross(found, side)), 0, 1e-12);
  EXPECT_NEAR(dot(found, found), 1, 1e-12);
  EXPECT_EQ(smallest_box_side({{2, 3}, {2, 3}}), (Vec2d{1, 0}));
  EXPECT_EQ(smallest_box_side({}), (Vec2d{1, 0}));
}

}  // namespace texmesh::flat_chart_test
