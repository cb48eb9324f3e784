#include "format/rules/jnd_choice.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::jnd_choice_test {

/// The thesis's Table 7.1, averages, and Table 7.2.
const std::vector<float> kTable71{0, 0.0410f, 0.0412f, 0.0478f, 0.0468f, 0.0678f};
const std::vector<float> kTable72{0, 0.0410f, 0.0616f, 0.0677f, 0.0759f, 0.1080f};

/// A table of values whose row 0 is printed and whose other rows are 0.
std::vector<float> printed_row() {
  std::vector<float> value(36, 0);
  for (std::size_t j = 0; j < 6; ++j) value[j] = kTable72[j];
  return value;
}

TEST(JndChoice, ChainsByTheRootOfTheSumOfSquares) {
  const std::vector<float> value = chained_values(kTable71);
  EXPECT_FLOAT_EQ(value[1], 0.0410f);
  // sqrt(.0410^2 + .0412^2) = sqrt(.001681 + .00169744) = .0581244
  EXPECT_NEAR(value[2], 0.0581244, 1e-6);
  EXPECT_NEAR(value[5], 0.11158, 1e-5);
  EXPECT_FLOAT_EQ(value[3 * 6 + 4], 0.0468f);
  EXPECT_EQ(value[4 * 6 + 3], 0);
}

/// Fig. 7.13: "S_4 is used instead of S_1 because it has perceived similarity (Table 7.2)".
TEST(JndChoice, Table72MakesS4TheFirstMajorScale) {
  EXPECT_EQ(coarsest_alike(printed_row(), 6, 0, 0.10), 4u);
  EXPECT_EQ(major_rows(printed_row(), 6, 0.10), (std::vector<std::uint8_t>{0, 0, 0, 0, 1, 1}));
  // Of Table 7.1's own values S_4 is the last below the JND, too: .0886 and .1116.
  EXPECT_EQ(coarsest_alike(chained_values(kTable71), 6, 0, 0.10), 4u);
}

TEST(JndChoice, JndsOfClients) {
  EXPECT_EQ(coarsest_alike(printed_row(), 6, 0, 0.04), 0u);
  EXPECT_EQ(coarsest_alike(printed_row(), 6, 0, 0.0410 + 1e-6), 1u);
  EXPECT_EQ(coarsest_alike(printed_row(), 6, 0, static_cast<double>(0.0410f)), 0u) << "below, not equal";
  EXPECT_EQ(coarsest_alike(printed_row(), 6, 0, 1), 5u);
  EXPECT_EQ(major_rows(chained_values(kTable71), 6, 0), (std::vector<std::uint8_t>{0, 1, 1, 1, 1, 1}));
  EXPECT_EQ(major_rows(chained_values(kTable71), 6, 1), (std::vector<std::uint8_t>{0, 0, 0, 0, 0, 1}));
  EXPECT_EQ(major_rows({}, 0, 0.1), std::vector<std::uint8_t>{});
  EXPECT_EQ(major_rows(std::vector<float>{0}, 1, 0.1), std::vector<std::uint8_t>{0});
}

TEST(JndChoice, RefinesOnlyAsFarAsItShows) {
  const std::vector<float> value = printed_row();
  EXPECT_EQ(refine_to(value, 6, 5, 0, 0.10), 4u);  // S_5 -> S_0: S_4 is enough
  EXPECT_EQ(refine_to(value, 6, 5, 0, 0.11), 5u);  // nothing to see
  EXPECT_EQ(refine_to(value, 6, 4, 0, 0.10), 4u);
  EXPECT_EQ(refine_to(value, 6, 5, 0, 0.04), 0u);
  EXPECT_EQ(refine_to(value, 6, 2, 3, 0.04), 2u);  // a coarser one is wanted
  EXPECT_EQ(refine_to(value, 6, 2, 2, 0.04), 2u);
}

TEST(JndChoice, StatisticsAndChainsComeFromTheirOwnArrays) {
  PerceptualTable t;
  t.scale = {0, 1, 2}, t.average = {0, 0.3f, 0.4f}, t.largest = {0, 0.6f, 0.8f}, t.least = {0, 0.75f, 1};
  t.p95 = {1, 2, 3}, t.chain_average = {4, 5, 6}, t.chain_largest = {7, 8, 9}, t.chain_least = {10, 11, 12};
  const auto row = [](const std::vector<float>& v) { return std::vector<float>{v[1], v[2], v[5]}; };
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kP95)), (std::vector<float>{1, 2, 3}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kP95, ChainRule::kSurvivor)),
            (std::vector<float>{1, 2, 3}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kAverage)), (std::vector<float>{0.3f, 0.5f, 0.4f}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kConservative)), (std::vector<float>{0.6f, 1.0f, 0.8f}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kAggressive)), (std::vector<float>{0.75f, 1.25f, 1}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kAverage, ChainRule::kSurvivor)),
            (std::vector<float>{4, 5, 6}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kConservative, ChainRule::kSurvivor)),
            (std::vector<float>{7, 8, 9}));
  EXPECT_EQ(row(pair_values(t, PerceptualStatistic::kAggressive, ChainRule::kSurvivor)),
            (std::vector<float>{10, 11, 12}));
}

}  // namespace texmesh::jnd_choice_test
