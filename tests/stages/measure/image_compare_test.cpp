#include "stages/measure/flip.h"

#include <gtest/gtest.h>

namespace texmesh::image_compare_test {

Picture grey(float level, std::uint32_t side = 32) {
  return {side, std::vector<Vec3f>(side * side, {level, level, level}),
          std::vector<std::uint8_t>(side * side, 1)};
}

TEST(ImageCompare, EqualIsEqualAndStructureCounts) {
  const LumaPicture a = prepare_luma(grey(0.2f));
  const PictureDifference same = compare_luma(a, a);
  EXPECT_EQ(same.pixels, 1024u);
  EXPECT_NEAR(same.ssim / 1024, 1, 1e-9);

  const double lighter = compare_luma(a, prepare_luma(grey(0.22f))).ssim,
               bright = compare_luma(a, prepare_luma(grey(0.6f))).ssim;
  EXPECT_LT(lighter, same.ssim);
  EXPECT_LT(bright, lighter);
  Picture striped = grey(0.2f);
  for (std::size_t i = 0; i < striped.linear.size(); i += 2) striped.linear[i] = {0.3f, 0.3f, 0.3f};
  EXPECT_LT(compare_luma(a, prepare_luma(striped)).ssim / 1024, 0.5);
}

TEST(ImageCompare, OnlyCoveredPixelsCount) {
  Picture a = grey(0.2f), b = grey(0.2f);
  std::fill(a.covered.begin(), a.covered.end(), 0);
  std::fill(b.covered.begin(), b.covered.end(), 0);
  EXPECT_EQ(compare_luma(prepare_luma(a), prepare_luma(b)).pixels, 0u);
  a.covered[5] = 1;
  b.covered[9] = 1;
  EXPECT_EQ(compare_luma(prepare_luma(a), prepare_luma(b)).pixels, 2u);
}

}  // namespace texmesh::image_compare_test
