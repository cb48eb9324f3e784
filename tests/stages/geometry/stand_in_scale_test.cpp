#include "stages/geometry/scale_frames.h"

#include <gtest/gtest.h>

namespace texmesh::stand_in_scale_test {

NestedScales scales_of(const std::vector<std::pair<std::size_t, float>>& triangles_and_errors) {
  NestedScales out;
  for (const auto& [triangles, error] : triangles_and_errors) {
    NestedScale& s = out.scales.emplace_back();
    s.triangles.resize(triangles);
    s.error_rms = error;
  }
  return out;
}

TEST(StandInScale, IsTheFinestWithinTheLimit) {
  const NestedScales s = scales_of({{1000, 0}, {600, .1f}, {360, .2f}, {210, .3f}});
  EXPECT_EQ(stand_in_scale(s, 1000, 1), 0u);
  EXPECT_EQ(stand_in_scale(s, 999, 1), 1u);
  EXPECT_EQ(stand_in_scale(s, 400, 1), 2u);
  EXPECT_EQ(stand_in_scale(s, 210, 1), 3u);
}

TEST(StandInScale, IsFinerWhereNoneIsNear) {
  const NestedScales s = scales_of({{1000, 0}, {900, .1f}, {100, .2f}});
  EXPECT_EQ(stand_in_scale(s, 400, 1), 1u);    // 100 are less than half of what was asked for
  EXPECT_EQ(stand_in_scale(s, 200, .15), 1u);  // too far from S_0
  EXPECT_EQ(stand_in_scale(s, 200, .05), 0u);
  EXPECT_EQ(stand_in_scale(s, 10, 1), 2u);
}

}  // namespace texmesh::stand_in_scale_test
