#include "stages/measure/flip.h"

#include <gtest/gtest.h>

namespace texmesh::flip_test {

/// A striped object, `left` px from the side of a grey picture.
Picture striped(std::uint32_t side, std::uint32_t left, float value) {
  Picture p;
  p.side_px = side;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const bool object = x >= left && x < left + 20 && y >= 30 && y < 66;
      p.linear.push_back(object ? Vec3f{value, (x - left) / 3 % 2 ? 0.5f : 0.2f, value}
                                : Vec3f{0.2f, 0.2f, 0.2f});
      p.covered.push_back(object);
    }
  return p;
}

FlipSum compare(const Picture& a, const Picture& b) { return compare_flip(prepare_flip(a), prepare_flip(b)); }

TEST(Flip, SumsOverWhatEitherCovers) {
  const FlipSum apart = compare(striped(100, 5, 0.5f), striped(100, 60, 0.5f));
  EXPECT_EQ(apart.pixels, 2u * 20 * 36);
  const FlipSum same = compare(striped(100, 40, 0.5f), striped(100, 40, 0.5f));
  EXPECT_EQ(same.pixels, 20u * 36);
  EXPECT_EQ(same.mean(), 0);
  EXPECT_EQ(same.percentile(0.95), 0);
  EXPECT_EQ(same.histogram[0], same.pixels);
}

TEST(Flip, PlaceAndSizeOfThePictureDoNotMatter) {
  const double here = compare(striped(100, 40, 0.5f), striped(100, 40, 0.4f)).mean();
  EXPECT_GT(here, 0.01);
  EXPECT_NEAR(here, compare(striped(240, 71, 0.5f), striped(240, 71, 0.4f)).mean(), 1e-6);
}

TEST(Flip, APictureThatIsComparedOnceIsFilteredWhereItMatters) {
  Picture empty = striped(100, 20, 0.2f);
  empty.linear.assign(empty.linear.size(), {0.2f, 0.2f, 0.2f});
  empty.covered.assign(empty.covered.size(), 0);
  const std::vector<Picture> pictures{striped(100, 5, 0.5f), striped(100, 9, 0.4f), striped(100, 60, 0.5f),
                                      striped(100, 80, 0.9f), empty};
  for (const Picture& a : pictures)
    for (const Picture& b : pictures) {
      const FlipSum once = compare_flip(prepare_flip(a), b), whole = compare(a, b);
      EXPECT_EQ(once.sum, whole.sum);
      EXPECT_EQ(once.histogram, whole.histogram);
    }
}

TEST(Flip, PercentilesAreOfAllPicturesTogether) {
  FlipSum sum = compare(striped(100, 40, 0.5f), striped(100, 40, 0.4f));
  const double alone = sum.percentile(0.95), mean = sum.mean();
  EXPECT_GT(alone, mean);
  EXPECT_LE(sum.percentile(0.5), alone);
  sum.add(compare(striped(100, 40, 0.5f), striped(100, 40, 0.5f)));
  EXPECT_NEAR(sum.mean(), mean / 2, 1e-12);
  EXPECT_EQ(sum.percentile(0.49), 0) << "half of the pixels are equal";
  EXPECT_LE(sum.percentile(0.95), alone);
  sum.add(FlipSum{});
  EXPECT_NEAR(sum.mean(), mean / 2, 1e-12);
}

TEST(Flip, NothingCoveredIsNoDifference) {
  Picture empty = striped(64, 20, 0.5f);
  empty.linear.assign(empty.linear.size(), {0.2f, 0.2f, 0.2f});
  empty.covered.assign(empty.covered.size(), 0);
  const FlipSum sum = compare(empty, empty);
  EXPECT_EQ(sum.pixels, 0u);
  EXPECT_EQ(sum.mean(), 0);
  EXPECT_EQ(sum.percentile(0.95), 0);
  EXPECT_EQ(compare(empty, striped(64, 20, 0.5f)).pixels, 20u * 34);
}

}  // namespace texmesh::flip_test
