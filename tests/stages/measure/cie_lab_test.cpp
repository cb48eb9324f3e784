#include "stages/measure/cie_lab.h"

#include <gtest/gtest.h>

namespace texmesh::cie_lab_test {

TEST(CieLab, WhiteAndBlackAreTheEndsOfLightness) {
  const Vec3f white = hunt_lab(kWhiteXyz, lab_root), black = hunt_lab({0, 0, 0}, lab_root);
  EXPECT_NEAR(white.x, 100, 1e-4);
  EXPECT_NEAR(white.y, 0, 1e-3);
  EXPECT_NEAR(white.z, 0, 1e-3);
  EXPECT_NEAR(black.x, 0, 1e-4);
  EXPECT_NEAR(hyab<double>(white, black), 100, 1e-3);
  EXPECT_NEAR(hyab<float>(white, black), 100, 1e-3);
}

TEST(CieLab, OpponentColoursAndLinearOnesGoThereAndBack) {
  for (const Vec3f colour : {Vec3f{0, 0, 0}, {1, 1, 1}, {0.2f, 0.7f, 0.1f}, {0.9f, 0, 0.4f}}) {
    const Vec3f back = linear_of_xyz(xyz_of_opponent(opponent_of_xyz(xyz_of_linear(colour))));
    for (int k = 0; k < 3; ++k) EXPECT_NEAR(back[k], colour[k], 1e-5);
  }
  const Vec3d white = opponent_of_xyz(kWhiteXyz);
  EXPECT_NEAR(white.x, 100, 1e-9);
  EXPECT_NEAR(white.y, 0, 1e-9);
  EXPECT_NEAR(white.z, 0, 1e-9);
}

TEST(CieLab, TheRootIsContinuousWhereItsLineBegins) {
  constexpr double kJoint = 216.0 / 24389;
  EXPECT_NEAR(lab_root(kJoint - 1e-12), lab_root(kJoint + 1e-12), 1e-9);
  EXPECT_NEAR(lab_root(1), 1, 1e-12);
}

TEST(RemappedDifference, SmallDifferencesGetNearlyAllOfTheRange) {
  EXPECT_EQ(remapped_difference(0.0, 10.0), 0);
  EXPECT_DOUBLE_EQ(remapped_difference(2.0, 10.0), 0.475);
  EXPECT_DOUBLE_EQ(remapped_difference(4.0, 10.0), 0.95);
  EXPECT_DOUBLE_EQ(remapped_difference(10.0, 10.0), 1);
  EXPECT_EQ(remapped_difference(11.0, 10.0), 1) << "beyond the largest";
}

}  // namespace texmesh::cie_lab_test
