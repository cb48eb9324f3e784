#include "format/base/portable_math.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>

namespace texmesh::portable_math_test {

TEST(PortableMath, AgreesWithLibmToTheLastFewBits) {
  for (int i = -2000; i <= 2000; ++i) {
    const double x = i * 0.01373;
    EXPECT_NEAR(portable::sin(x), std::sin(x), 4e-16 * (1 + std::fabs(x)));
    EXPECT_NEAR(portable::cos(x), std::cos(x), 4e-16 * (1 + std::fabs(x)));
    EXPECT_NEAR(portable::exp(x) / std::exp(x), 1, 1e-15);
    EXPECT_NEAR(portable::atan2(x, 1.7), std::atan2(x, 1.7), 1e-15);
    EXPECT_NEAR(portable::atan2(0.3, x), std::atan2(0.3, x), 1e-15);
    if (i > 0) {
      EXPECT_NEAR(portable::log(x), std::log(x), 1e-15 * (1 + std::fabs(std::log(x))));
      EXPECT_NEAR(portable::pow(x, 0.37) / std::pow(x, 0.37), 1, 1e-14);
    }
  }
}

TEST(PortableMath, Limits) {
  EXPECT_EQ(portable::exp(0), 1);
  EXPECT_EQ(portable::exp(-1000), 0);
  EXPECT_TRUE(std::isinf(portable::exp(1000)));
  EXPECT_EQ(portable::log(1), 0);
  EXPECT_TRUE(std::isinf(portable::log(0)));
  EXPECT_TRUE(std::isnan(portable::log(-1)));
  EXPECT_EQ(portable::sin(0), 0);
  EXPECT_EQ(portable::cos(0), 1);
  EXPECT_EQ(portable::atan2(0, 0), 0);
}

#if defined(__SANITIZE_ADDRESS__)
TEST(Sanitizers, ANumberThatNoIntegerHoldsEndsTheProgram) {
  const volatile double far = 1e30;
  EXPECT_DEATH(std::printf("%d", static_cast<int>(far)), "outside the range of representable values");
}
#endif

}  // namespace texmesh::portable_math_test
