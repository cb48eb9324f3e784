#include "stages/measure/image_compare.h"

#include <gtest/gtest.h>

namespace texmesh {
namespace {

Picture grey(float level, std::uint32_t side = 32) {
  return {side, std::vector<Vec3f>(side * side, {level, level, level}),
          std::vector<std::uint8_t>(side * side, 1)};
}

TEST(ImageCompare, EqualIsEqualAndColoursCount) {
  const ComparedPicture a = prepare_comparison(grey(0.2f));
  const PictureDifference same = compare_pictures(a, a);
  EXPECT_EQ(same.pixels, 1024u);
  EXPECT_NEAR(same.ssim / 1024, 1, 1e-9);
  EXPECT_EQ(same.difference, 0);

  const PictureDifference lighter = compare_pictures(a, prepare_comparison(grey(0.22f)));
  const PictureDifference bright = compare_pictures(a, prepare_comparison(grey(0.6f)));
  EXPECT_GT(lighter.difference, 0);
  EXPECT_GT(bright.difference, 3 * lighter.difference);

  Picture red = grey(0.2f);
  for (Vec3f& c : red.linear) c = {0.5f, 0.12f, 0.12f};
  const PictureDifference hue = compare_pictures(a, prepare_comparison(red));
  EXPECT_GT(hue.difference / 1024, 0.2);
}

// The largest difference that FLIP knows, by definition nearly 1 (green against blue).
TEST(ImageCompare, GreenAgainstBlueIsOne) {
  Picture green = grey(0), blue = grey(0);
  for (Vec3f& c : green.linear) c = {0, 1, 0};
  for (Vec3f& c : blue.linear) c = {0, 0, 1};
  const PictureDifference d = compare_pictures(prepare_comparison(green), prepare_comparison(blue));
  EXPECT_NEAR(d.difference / 1024, 1, 1e-3);
}

TEST(ImageCompare, OnlyCoveredPixelsCount) {
  Picture a = grey(0.2f), b = grey(0.2f);
  std::fill(a.covered.begin(), a.covered.end(), 0);
  std::fill(b.covered.begin(), b.covered.end(), 0);
  EXPECT_EQ(compare_pictures(prepare_comparison(a), prepare_comparison(b)).pixels, 0u);
  a.covered[5] = 1;
  b.covered[9] = 1;
  EXPECT_EQ(compare_pictures(prepare_comparison(a), prepare_comparison(b)).pixels, 2u);
}

}  // namespace
}  // namespace texmesh
