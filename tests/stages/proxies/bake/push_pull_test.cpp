#include "stages/proxies/bake/bake.h"

#include <gtest/gtest.h>

namespace texmesh::push_pull_test {

TEST(PushPull, CoveredValuesStayAndOthersLieBetweenThem) {
  constexpr std::uint32_t kWidth = 13, kHeight = 7;
  std::vector<Vec3f> values(kWidth * kHeight, Vec3f{99, 99, 99});
  std::vector<std::uint8_t> covered(values.size(), 0);
  values[0] = {1, 0, 5}, covered[0] = 1;
  values.back() = {0, 1, 5}, covered.back() = 1;
  push_pull(values, covered, kWidth, kHeight);
  EXPECT_EQ(values.front(), (Vec3f{1, 0, 5}));
  EXPECT_EQ(values.back(), (Vec3f{0, 1, 5}));
  for (const Vec3f v : values) {
    EXPECT_NEAR(v.x + v.y, 1, 1e-5);
    EXPECT_NEAR(v.z, 5, 1e-5);
    EXPECT_GE(v.x, -1e-6f);
  }
  EXPECT_GT(values[1].x, 0.6f) << "near the first";
  EXPECT_GT(values[values.size() - 2].y, 0.6f) << "near the last";
}

TEST(PushPull, NothingCoveredChangesNothing) {
  std::vector<Vec3f> values(6, Vec3f{1, 2, 3});
  push_pull(values, std::vector<std::uint8_t>(6, 0), 3, 2);
  for (const Vec3f v : values) EXPECT_EQ(v, (Vec3f{1, 2, 3}));
}

}  // namespace texmesh::push_pull_test
