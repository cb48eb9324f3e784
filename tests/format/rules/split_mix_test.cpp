// Random numbers that are the same everywhere.
#include "format/rules/split_mix.h"

#include <gtest/gtest.h>

namespace texmesh::split_mix_test {

TEST(SplitMix, GivesThePublishedNumbers) {
  SplitMix random(1234567);  // the values that implementations are compared by
  EXPECT_EQ(random.bits(), 6457827717110365317ull);
  EXPECT_EQ(random.bits(), 3203168211198807973ull);
  EXPECT_EQ(random.bits(), 9817491932198370423ull);
}

TEST(SplitMix, UnitsAreEvenBetween0And1) {
  SplitMix random(1);
  double sum = 0;
  for (int i = 0; i < 100000; ++i) {
    const double x = random.next();
    ASSERT_GE(x, 0);
    ASSERT_LT(x, 1);
    sum += x;
  }
  EXPECT_NEAR(sum / 100000, 0.5, 0.01);
}

}  // namespace texmesh::split_mix_test
