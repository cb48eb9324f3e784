#include "format/rules/size_curve.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "format/documents/tables.h"
#include "tests/format/documents/tables_fixture.h"

namespace texmesh::size_curve_test {

using testing::make_tables;

/// Sizes of fragment 0 never fall, and stay at those of the outer rungs outside of them.
void expect_rising(const PlaneTables& t, double first, double last) {
  double before = 0;
  for (double q = 1; q <= 100; q += 0.25) {
    const double v = interpolated_bytes(t, 0, q);
    EXPECT_GE(v, before * (1 - 1e-12)) << q;
    before = v;
  }
  EXPECT_DOUBLE_EQ(interpolated_bytes(t, 0, 1), first);
  EXPECT_DOUBLE_EQ(interpolated_bytes(t, 0, 100), last);
}

TEST(InterpolatedBytes, ExactAtRungsAndMonotoneBetween) {
  PlaneTables t = make_tables(2, 1, 6, 1);
  t.knot_quality.clear(), t.knot_position.clear();
  t.rung_quality = {5, 11, 30, 53, 86, 97};
  const std::vector<std::uint32_t> sizes{700, 1100, 2500, 2500, 9000, 30000};
  for (std::size_t r = 0; r < 6; ++r) t.size_bytes[r * 2] = sizes[r];
  for (std::size_t r = 0; r < 6; ++r) EXPECT_EQ(interpolated_bytes(t, 0, t.rung_quality[r]), sizes[r]);
  expect_rising(t, 700, 30000);
  EXPECT_NEAR(interpolated_bytes(t, 0, 40), 2500, 1e-6);
  EXPECT_EQ(interpolated_bytes(t, 1, 50), 0);  // not stored
  // Sizes that are a power of the mean of 1 / (step + 1) are met everywhere: its logarithm at the rungs, and
  // between them, from the quantisers as libjpeg scales them.
  const std::array<double, 6> at_rungs{-5.373343281, -4.941065062, -4.047754894,
                                       -3.492900817, -2.382324426, -1.238605843};
  const std::array<int, 6> qualities{6, 20, 45, 60, 75, 90};
  const std::array<double, 6> between{-5.292657063, -4.444225179, -3.656619744,
                                      -3.347971742, -2.920718465, -2.099480337};
  for (std::size_t r = 0; r < 6; ++r)
    t.size_bytes[r * 2] = static_cast<std::uint32_t>(std::lround(1e9 * std::exp(0.8 * at_rungs[r])));
  for (std::size_t k = 0; k < 6; ++k)
    EXPECT_NEAR(interpolated_bytes(t, 0, qualities[k]) / (1e9 * std::exp(0.8 * between[k])), 1, 1e-6);
  const double middle = interpolated_bytes(t, 0, 45.5);
  EXPECT_GT(middle, interpolated_bytes(t, 0, 45));
  EXPECT_LT(middle, interpolated_bytes(t, 0, 46));
  PlaneTables one = make_tables(1, 1, 1, 1);
  EXPECT_DOUBLE_EQ(interpolated_bytes(one, 0, 80), one.size_bytes[0]);
}

TEST(InterpolatedBytes, KnotsBendTheWayBetweenRungs) {
  PlaneTables t = make_tables(2, 1, 6, 1);
  t.rung_quality = {5, 11, 30, 53, 86, 97};
  const std::vector<std::uint32_t> sizes{700, 1100, 2500, 2500, 9000, 30000};
  for (std::size_t r = 0; r < 6; ++r) t.size_bytes[r * 2] = sizes[r];
  t.knot_quality = {8, 20, 25, 40, 60, 70, 80};
  const std::vector<double> bytes{750, 1200, 9999, 2600, 2500, 8000, 8900};  // some beyond their rungs'
  t.knot_position = knot_positions(t.rung_quality, {sizes.begin(), sizes.end()}, t.knot_quality, bytes);
  for (std::size_t r = 0; r < 6; ++r) EXPECT_EQ(interpolated_bytes(t, 0, t.rung_quality[r]), sizes[r]);
  const std::vector<double> met{750, 1200, 2500, 2500, 2500, 8000, 8900};
  for (std::size_t k = 0; k < met.size(); ++k)
    EXPECT_NEAR(interpolated_bytes(t, 0, t.knot_quality[k]), met[k], met[k] * 1e-4) << k;
  expect_rising(t, 700, 30000);
  // Where there is no knot, and with one where the quality lies anyway, nothing changes.
  PlaneTables plain = t;
  plain.knot_quality.clear(), plain.knot_position.clear();
  EXPECT_NEAR(interpolated_bytes(t, 0, 90) / interpolated_bytes(plain, 0, 90), 1, 1e-12);
  EXPECT_GT(interpolated_bytes(t, 0, 70) / interpolated_bytes(plain, 0, 70), 1.2);
  std::vector<double> same;
  for (const std::uint8_t q : t.knot_quality) same.push_back(interpolated_bytes(plain, 0, q));
  t.knot_position = knot_positions(t.rung_quality, {sizes.begin(), sizes.end()}, t.knot_quality, same);
  for (double q = 1; q <= 100; q += 0.5)
    EXPECT_NEAR(interpolated_bytes(t, 0, q) / interpolated_bytes(plain, 0, q), 1, 1e-5) << q;
  // A fragment that some rungs lack takes the same way between those that it has.
  t.size_bytes[2] = 0;
  EXPECT_GT(interpolated_bytes(t, 0, 12), 700);
  EXPECT_LT(interpolated_bytes(t, 0, 12), interpolated_bytes(t, 0, 13));
}

}  // namespace texmesh::size_curve_test
