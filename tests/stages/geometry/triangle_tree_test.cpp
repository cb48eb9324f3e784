#include "stages/geometry/triangle_tree.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh::triangle_tree_test {

struct Soup {
  std::vector<Vec3d> points;
  std::vector<Triangle> triangles;
};

/// Squares of side 2 at z = heights, facing +Z, or -Z where `up` is false.
Soup squares(const std::vector<std::pair<double, bool>>& heights) {
  Soup out;
  for (const auto& [z, up] : heights) {
    const auto first = static_cast<std::uint32_t>(out.points.size());
    for (const Vec2d p : {Vec2d{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) out.points.push_back({p.x, p.y, z});
    for (Triangle t : {Triangle{0, 1, 2}, Triangle{0, 2, 3}}) {
      if (!up) std::swap(t[1], t[2]);
      out.triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
    }
  }
  return out;
}

constexpr TriangleTree::Facing kUp{{0, 0, 1}, 0};

TEST(TriangleTree, ALineTakesTheNearestTriangleThatLooksTheSameWayOnEitherSide) {
  const Soup soup = squares({{0.5, true}, {-0.3, true}, {0.1, false}});
  const TriangleTree tree(soup.points, soup.triangles);
  const auto found = tree.crossing({0.5, -0.2, 0}, {0, 0, 1}, 1, kUp, std::nullopt);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->triangle / 2, 1u)
      << "behind, but nearer than the one before, and the one between looks away";
  EXPECT_NEAR(found->weight[0] + found->weight[1] + found->weight[2], 1, 1e-12);
  EXPECT_FALSE(tree.crossing({0.5, -0.2, 0}, {0, 0, 1}, 0.29, kUp, std::nullopt)) << "beyond the reach";
  EXPECT_FALSE(tree.crossing({1.5, -0.2, 0}, {0, 0, 1}, 1, kUp, std::nullopt)) << "beside";
}

TEST(TriangleTree, OfEqualDistancesTheLowestIndexCounts) {
  const Soup soup = squares({{0.25, true}, {-0.25, true}, {0.25, true}});
  const TriangleTree tree(soup.points, soup.triangles);
  const auto found = tree.crossing({0.5, -0.2, 0}, {0, 0, 1}, 1, kUp, std::nullopt);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->triangle, 0u);
  const auto nearest = tree.nearest_facing({0.5, -0.2, 0}, kUp);
  ASSERT_TRUE(nearest);
  EXPECT_EQ(nearest->triangle, 0u);
}

TEST(TriangleTree, AGuessChangesNothing) {
  const Mesh mesh = testing::even_sphere(4, 0.2);
  std::vector<Vec3d> points;
  for (const Vec3f p : mesh.positions) points.push_back(to_double(p));
  const TriangleTree tree(points, mesh.triangles);
  testing::Random random{3};
  std::size_t hits = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vec3d p{random.uniform() * 2 - 1, random.uniform() * 2 - 1, random.uniform() * 2 - 1};
    const Vec3d n = normalized(p);
    const TriangleTree::Facing facing{n, 0.1};
    const auto plain = tree.crossing(p, n, 0.4, facing, std::nullopt);
    const auto guessed = tree.crossing(p, n, 0.4, facing, random.next() % mesh.triangles.size());
    ASSERT_EQ(plain.has_value(), guessed.has_value());
    if (!plain) continue;
    ++hits;
    EXPECT_EQ(plain->triangle, guessed->triangle);
    EXPECT_EQ(plain->weight, guessed->weight);
  }
  EXPECT_GT(hits, 200u);
}

/// What a look at every triangle finds, far from 0 and along the axes as well.
TEST(TriangleTree, ALineMissesNoTriangle) {
  const Mesh mesh = testing::even_sphere(4, 0.2);
  for (const Vec3d moved : {Vec3d{}, Vec3d{3000, -70, 0.5}}) {
    std::vector<Vec3d> points;
    for (const Vec3f p : mesh.positions) points.push_back(to_double(p) + moved);
    const TriangleTree tree(points, mesh.triangles);
    std::vector<TriangleTree> alone;
    for (const Triangle& t : mesh.triangles) alone.emplace_back(points, std::vector{t});
    testing::Random random{7};
    for (int i = 0; i < 300; ++i) {
      const Vec3d p{random.uniform() * 2 - 1, random.uniform() * 2 - 1, random.uniform() * 2 - 1};
      const Vec3d towards = i % 3 == 0 ? Vec3d{0, i % 2 ? 1. : -1., 0} : normalized(p);
      const TriangleTree::Facing facing{towards, -0.5};
      const auto found = tree.crossing(p + moved, towards, 0.4, facing, std::nullopt);
      std::optional<std::uint32_t> expected;
      double least = 0.4;
      for (std::uint32_t t = 0; t < alone.size(); ++t) {
        const auto one = alone[t].crossing(p + moved, towards, 0.4, facing, std::nullopt);
        if (!one) continue;
        Vec3d place;
        for (std::size_t k = 0; k < 3; ++k) place = place + points[mesh.triangles[t][k]] * one->weight[k];
        const double distance = length(place - p - moved);
        if (distance < least) least = distance, expected = t;
      }
      ASSERT_EQ(found.has_value(), expected.has_value()) << i;
      if (found) EXPECT_EQ(found->triangle, *expected) << i;
    }
  }
}

TEST(TriangleTree, TheNearestPointLooksTheSameWay) {
  const Soup soup = squares({{0.1, false}, {-2, true}});
  const TriangleTree tree(soup.points, soup.triangles);
  const auto found = tree.nearest_facing({3, 0, 0}, kUp);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->triangle / 2, 1u);
  EXPECT_FALSE(tree.nearest_facing({3, 0, 0}, {{1, 0, 0}, 0})) << "none looks there";
}

}  // namespace texmesh::triangle_tree_test
