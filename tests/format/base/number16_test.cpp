#include "format/base/number16.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace texmesh::number16_test {

TEST(Half, RoundsToNearestEven) {
  for (std::uint32_t code = 0; code <= kLargestHalf; ++code) {
    const float v = from_half(static_cast<std::uint16_t>(code));
    EXPECT_EQ(to_half(v), code);
    if (code == kLargestHalf) break;
    const float next = from_half(static_cast<std::uint16_t>(code + 1)),
                middle = (v + next) / 2;  // exact in float
    EXPECT_EQ(to_half(middle), code + (code & 1));
    EXPECT_EQ(to_half(std::nextafter(middle, 0.0f)), code);
    EXPECT_EQ(to_half(std::nextafter(middle, 1e9f)), code + 1);
  }
  EXPECT_EQ(from_half(0x3c00), 1.0f);
  EXPECT_EQ(from_half(1), 0x1p-24f);
  EXPECT_EQ(from_half(kLargestHalf), 65504.0f);
}

}  // namespace texmesh::number16_test
