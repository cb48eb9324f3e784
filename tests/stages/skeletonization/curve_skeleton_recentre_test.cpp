// Nodes of a curve find the middle of their poles, across the curve and not along it.
#include "stages/skeletonization/curve_skeleton.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

namespace texmesh::curve_skeleton_recentre_test {

/// Nodes at x = 0 .. count - 1, of height y.
CurveSkeleton line(int count, double y) {
  CurveSkeleton out;
  for (int k = 0; k < count; ++k) {
    out.nodes.push_back({static_cast<double>(k), y, 0});
    if (k > 0) out.segments.push_back({static_cast<std::uint32_t>(k - 1), static_cast<std::uint32_t>(k)});
  }
  return out;
}

TEST(Recentre, AcrossTheCurveAndNotAlongIt) {
  CurveSkeleton curve = line(9, 0.5);
  std::vector<NodePoles> poles;
  for (int k = 0; k < 9; ++k) poles.push_back({Vec3d{k + 0.3, 0, 0} * 2, 2});
  recentre(curve, poles);
  for (int k = 0; k < 9; ++k) {
    EXPECT_NEAR(curve.nodes[static_cast<std::size_t>(k)].x, k, 1e-12);
    EXPECT_NEAR(curve.nodes[static_cast<std::size_t>(k)].y, 0, 1e-12);
  }
}

TEST(Recentre, TheOrderOfSegmentsAndTheirDirectionsDoNotMatter) {
  CurveSkeleton curve = line(3, 1);
  curve.segments = {{2, 1}, {1, 0}};
  recentre(curve, std::vector<NodePoles>(3, {Vec3d{1, 0, 0}, 1}));
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(curve.nodes[static_cast<std::size_t>(k)].x, k, 1e-12);
    EXPECT_NEAR(curve.nodes[static_cast<std::size_t>(k)].y, 0, 1e-12);
  }
}

TEST(Recentre, OneNodesPolesAreSharedWithItsNeighboursAndNobodyElse) {
  CurveSkeleton curve = line(40, 0);
  std::vector<NodePoles> poles(40);
  poles[3] = {Vec3d{3, 1, 0}, 1};
  recentre(curve, poles);
  for (std::size_t k = 0; k < 40; ++k) EXPECT_NEAR(curve.nodes[k].y, k <= 3 + 16 ? 1 : 0, 1e-12) << k;
}

TEST(Recentre, ANoisyPoleIsSmoothed) {
  CurveSkeleton curve = line(80, 0);
  std::vector<NodePoles> poles;
  for (int k = 0; k < 80; ++k) poles.push_back({Vec3d{static_cast<double>(k), k == 40 ? 1.0 : 0.0, 0}, 1});
  recentre(curve, poles);
  double sum = 0;
  for (const Vec3d& n : curve.nodes) {
    EXPECT_LT(std::fabs(n.y), 0.15);
    sum += n.y;
  }
  EXPECT_NEAR(sum, 1, 1e-9) << "what it pulls is spread, not lost";
}

TEST(Recentre, BranchesAndLoneNodesMoveAnywhere) {
  CurveSkeleton lone{{{1, 1, 1}}, {}};
  recentre(lone, std::vector<NodePoles>{{Vec3d{4, 6, 8}, 2}});
  EXPECT_EQ(lone.nodes[0], (Vec3d{2, 3, 4}));
  CurveSkeleton star{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, {{0, 1}, {0, 2}, {3, 0}}};
  std::vector<NodePoles> poles;
  for (const Vec3d& n : star.nodes) poles.push_back({n + Vec3d{0.1, 0.1, 0.1}, 1});
  recentre(star, poles);
  for (int k = 0; k < 3; ++k) EXPECT_NEAR(star.nodes[0][k], 0.1, 1e-12);
  EXPECT_NEAR(star.nodes[1].x, 1, 1e-12);
}

TEST(Recentre, WithoutPolesNothingMoves) {
  CurveSkeleton curve = line(4, 2);
  curve.segments.push_back({2, 2});
  const CurveSkeleton before = curve;
  recentre(curve, std::vector<NodePoles>(4));
  EXPECT_EQ(curve.nodes, before.nodes);
  CurveSkeleton same{{{0, 0, 0}, {0, 0, 0}}, {{0, 1}}};  // a segment of no length
  recentre(same, std::vector<NodePoles>(2, {Vec3d{1, 0, 0}, 1}));
  EXPECT_EQ(same.nodes[0], (Vec3d{1, 0, 0}));
}

}  // namespace texmesh::curve_skeleton_recentre_test
