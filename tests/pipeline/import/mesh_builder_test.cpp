#include "pipeline/import/mesh_builder.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace texmesh::mesh_builder_test {

TEST(LinearFromSrgb, EndsAndMiddle) {
  EXPECT_EQ(linear_from_srgb(0), 0);
  EXPECT_EQ(linear_from_srgb(1), 1);
  EXPECT_EQ(linear_from_srgb(-3), 0);
  EXPECT_EQ(linear_from_srgb(7), 1);
  EXPECT_EQ(linear_from_srgb(std::nan("")), 1);
  EXPECT_NEAR(linear_from_srgb(0.5), 0.2140411, 1e-6);
}

}  // namespace texmesh::mesh_builder_test
