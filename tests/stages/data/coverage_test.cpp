#include "stages/data/fragments.h"

#include <gtest/gtest.h>

namespace texmesh::coverage_test {

TEST(CoverageMask, RowsStartAtWholeBytesAndTheirFirstTexelIsTheHighestBit) {
  EXPECT_EQ(coverage_stride_bytes(0), 0u);
  EXPECT_EQ(coverage_stride_bytes(1), 1u);
  EXPECT_EQ(coverage_stride_bytes(8), 1u);
  EXPECT_EQ(coverage_stride_bytes(9), 2u);
  EXPECT_EQ(coverage_stride_bytes(0xffffffff), 536870912u);
  EXPECT_EQ(coverage_size_bytes(9, 3), 6u);

  TexturePlane plane;
  plane.width_px = 9;
  plane.height_px = 2;
  plane.coverage = {0x80, 0x00, 0x01, 0x80};  // (0, 0), (7, 1), (8, 1)
  const CoverageMask mask(plane);
  for (std::uint32_t y = 0; y < 2; ++y)
    for (std::uint32_t x = 0; x < 9; ++x)
      EXPECT_EQ(mask.covered(x, y), (x == 0 && y == 0) || (x >= 7 && y == 1)) << x << ", " << y;
  EXPECT_EQ(mask.byte_at(7, 1), 0x01);
  EXPECT_EQ(mask.byte_at(8, 1), 0x80);
  EXPECT_FALSE(mask.empty());
  EXPECT_TRUE(CoverageMask().empty());
}

}  // namespace texmesh::coverage_test
