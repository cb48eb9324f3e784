#include "format/rules/allocation.h"

#include "format/documents/tables.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/base/bytes.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh::allocation_test {

using testing::make_tables;
PlaneTables allocation_case(std::uint8_t allocation) {
  PlaneTables t = make_tables(4, 1, 2, 2);
  t.allocation = allocation;
  t.rung_quality = {30, 75};
  t.covered_texels = {10, 10, 10, 0};
  t.features = {10, 20, 40, 1000, 7, 7, 7, 0};  // the uncovered fragment's count does not matter
  t.quality = {80, 40};
  return t;
}

TEST(Allocation, EtaIsMinMaxOverCoveredFragments) {
  const PlaneTables t = allocation_case(0);
  EXPECT_EQ(eta_of(t, 0), (std::vector<float>{0, 1 / 3.0f, 1, 0}));
  EXPECT_EQ(eta_of(t, 1), (std::vector<float>{0, 0, 0, 0}));  // all equal
  EXPECT_NEAR(mean_eta(t, 0), 4 / 9.0, 1e-7);
  EXPECT_EQ(mean_eta(t, 1), 0);
}

TEST(Allocation, Equation32) {
  const PlaneTables t = allocation_case(0);
  const auto q = quality_of(t, 0, 0.5);
  EXPECT_FLOAT_EQ(q[0], 50);  // 80 - 60 / 2
  EXPECT_FLOAT_EQ(q[1], 70);
  EXPECT_FLOAT_EQ(q[2], 97);  // 110, clipped
  EXPECT_FLOAT_EQ(quality_of(t, 1, 0)[0], 40);
}

TEST(Allocation, LogQuantiserForm) {
  PlaneTables t = allocation_case(1);
  t.log_width = 0.7f;
  const auto scale = [](double q) { return q < 50 ? 50 / q : 2 - q / 50; };
  const auto q = quality_of(t, 0, 4 / 9.0);
  for (std::size_t f = 0; f < 3; ++f) {
    const double eta = static_cast<double>(eta_of(t, 0)[f]);
    EXPECT_NEAR(scale(static_cast<double>(q[f])), scale(80) * std::exp(-(eta - 4 / 9.0) * 0.7), 1e-6);
  }
  // Crossing quality 50, where IJG's formula changes: 40 is scale 1.25, half of it is quality 68.75.
  t.features = {0, 1, 0, 0, 0, 1, 0, 0};
  t.log_width = static_cast<float>(std::log(2.0));
  EXPECT_NEAR(quality_of(t, 1, 0)[1], 68.75, 1e-4);
  EXPECT_NEAR(quality_of(t, 1, 0)[0], 40, 1e-4);
  EXPECT_NEAR(quality_of(t, 1, 1)[0], 20, 1e-4);
  t.log_width = 4;
  EXPECT_EQ(quality_of(t, 1, 0)[1], 97);  // clipped
  EXPECT_EQ(quality_of(t, 1, 1)[0], 5);
}

TEST(Allocation, NearestRungInLogQuantiserSpace) {
  PlaneTables t = allocation_case(1);
  t.rung_quality = {5, 30, 75, 100};
  EXPECT_EQ(nearest_rung(t, 1), 0u);
  EXPECT_EQ(nearest_rung(t, 30), 1u);
  // scale(30) = 5/3, scale(75) = 1/2: their geometric mean 0.9129 is quality 54.36, not 52.5.
  EXPECT_EQ(nearest_rung(t, 54.3), 1u);
  EXPECT_EQ(nearest_rung(t, 54.4), 2u);
  EXPECT_EQ(nearest_rung(t, 100), 3u);
  t.rung_quality = {75};
  EXPECT_EQ(nearest_rung(t, 5), 0u);
}

TEST(Allocation, PredictorsTakeEtasPlace) {
  PlaneTables t = allocation_case(kByVqp);
  t.vqp = {0.25f, 1, 0.5f, 0};
  for (const std::size_t row : {0u, 1u}) EXPECT_EQ(eta_of(t, row), t.vqp);
  EXPECT_NEAR(mean_eta(t, 0), 1.75 / 3, 1e-7);
  const auto q = quality_of(t, 0, 0.5);
  EXPECT_FLOAT_EQ(q[0], 65);  // 80 + (0.25 - 0.5) 60
  EXPECT_FLOAT_EQ(q[1], 97);  // 110, clipped
  EXPECT_FLOAT_EQ(q[2], 80);
  EXPECT_FLOAT_EQ(quality_of(t, 1, 0.5)[0], 25);
}

TEST(Allocation, DensityOfTheScaleTakesThatOfTheFinestsPlaceInVqp) {
  PlaneTables t = allocation_case(kByVqp);
  t.features = {7, 7, 7, 0, 10, 20, 40, 1000};  // at S_0 every vertex is a feature, as in range scans
  t.vqp = {0.25f, 0.5f, 0.5f, 0};
  t.density_weight = 0.25f;
  EXPECT_EQ(eta_of(t, 0), t.vqp);
  EXPECT_EQ(eta_of(t, 1), (std::vector<float>{0.25f, 0.5f + 0.25f / 3, 0.75f, 0}));
  std::swap_ranges(t.features.begin(), t.features.begin() + 4, t.features.begin() + 4);
  EXPECT_EQ(eta_of(t, 0), t.vqp);
  EXPECT_EQ(eta_of(t, 1)[2], 0.25f) << "less than at S_0";
  t.density_weight = 1;
  EXPECT_EQ(eta_of(t, 1)[2], 0) << "within 0 .. 1";
}

}  // namespace texmesh::allocation_test
