#include "stages/base/loss_curve.h"

#include <gtest/gtest.h>

namespace texmesh::loss_curve_test {

struct Way {
  double bytes = 0, loss = 0;
  friend bool operator==(const Way&, const Way&) = default;
};

TEST(LossCurve, KeepsWhatNoMixOfTwoOthersBeats) {
  const std::vector<Way> kept = convex_curve<Way>({{30, 1}, {10, 9}, {20, 6}, {20, 3}, {25, 2.6}, {40, 1}});
  EXPECT_EQ(kept, (std::vector<Way>{{10, 9}, {20, 3}, {30, 1}}));
  EXPECT_EQ(convex_curve<Way>({}), std::vector<Way>{});
}

TEST(LossCurve, StepsWhereBytesGainMost) {
  const std::vector<std::vector<Way>> curves{{{0, 9}, {10, 4}}, {{0, 9}, {10, 3}}, {{0, 9}}};
  const auto alike = [](std::size_t) { return 1.0; };
  EXPECT_EQ(best_step(curves, {0, 0, 0}, alike), 1u);
  EXPECT_EQ(best_step(curves, {0, 0, 0}, [](std::size_t c) { return c == 1 ? 0.0 : 1.0; }), 0u);
  EXPECT_EQ(best_step(curves, {1, 1, 0}, alike), 3u);
}

}  // namespace texmesh::loss_curve_test
