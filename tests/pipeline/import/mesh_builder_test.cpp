#include "pipeline/import/mesh_builder.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/finish_model.h"
#include "pipeline/import/import.h"
#include "pipeline/import/import_images.h"
#include "pipeline/import/local_frame.h"
#include "pipeline/import/text_scan.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

TEST(LinearFromSrgb, EndsAndMiddle) {
  EXPECT_EQ(linear_from_srgb(0), 0);
  EXPECT_EQ(linear_from_srgb(1), 1);
  EXPECT_EQ(linear_from_srgb(-3), 0);
  EXPECT_EQ(linear_from_srgb(7), 1);
  EXPECT_EQ(linear_from_srgb(std::nan("")), 1);
  EXPECT_NEAR(linear_from_srgb(0.5), 0.2140411, 1e-6);
}

}  // namespace
}  // namespace texmesh
