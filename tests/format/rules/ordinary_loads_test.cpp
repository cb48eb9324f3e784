#include "format/rules/viewing.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace texmesh::ordinary_loads_test {

TEST(OrdinaryLoads, SpanLinksDisplaysAndTimesOnLogarithmicScales) {
  const auto loads = ordinary_loads();
  ASSERT_EQ(loads.size(), 1000u);
  const auto check = [&](double OrdinaryLoad::*number, double least, double most) {
    double sum = 0, lowest = most, highest = least;
    for (const OrdinaryLoad& load : loads) {
      sum += std::log(load.*number);
      lowest = std::min(lowest, load.*number), highest = std::max(highest, load.*number);
    }
    EXPECT_GE(lowest, least);
    EXPECT_LE(highest, most);
    EXPECT_LT(lowest, 1.05 * least);
    EXPECT_GT(highest, 0.95 * most);
    EXPECT_NEAR(sum / 1000, std::log(std::sqrt(least * most)), 0.04 * std::log(most / least));
  };
  check(&OrdinaryLoad::bytes_s, 250e3, 6.25e6);
  check(&OrdinaryLoad::displayed_px, 200, 2000);
  check(&OrdinaryLoad::time_limit_s, 1, 10);
}

TEST(OrdinaryLoads, FewerAreTheFirstOfMore) {
  const auto few = ordinary_loads(3), more = ordinary_loads(5);
  ASSERT_EQ(few.size(), 3u);
  for (std::size_t k = 0; k < few.size(); ++k) {
    EXPECT_EQ(few[k].bytes_s, more[k].bytes_s);
    EXPECT_EQ(few[k].displayed_px, more[k].displayed_px);
    EXPECT_EQ(few[k].time_limit_s, more[k].time_limit_s);
  }
  EXPECT_NE(more[3].bytes_s, more[4].bytes_s);
}

}  // namespace texmesh::ordinary_loads_test
