// Estimates of throughput from transfers that have ended.
#include "delivery/cpp/decide/harmonic_time.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::throughput_test {

Throughput of(std::initializer_list<std::pair<double, double>> samples) {
  Throughput t(1000);
  for (const auto& [bytes, seconds] : samples) t.add(bytes, seconds);
  return t;
}

TEST(Throughput, IsBeta0UntilThereIsASample) {
  EXPECT_EQ(of({}).recent_bytes_s(1), 1000);
  EXPECT_EQ(of({}).recent_bytes_s(5), 1000);
  EXPECT_EQ(of({}).mean_bytes_s(3), 1000);
}

TEST(Throughput, WhatElseIsUnderWayHasItsPartOfTheFirstSeconds) {
  // Two of 500 bytes share a link: after a second one has ended, and nearly all of the other has come.
  for (const auto& [beta0, estimate] : {std::pair{100, 500}, {800, 800}, {5000, 1000}}) {
    Throughput t(static_cast<double>(beta0));
    t.add(500, 1, {1, 500});
    EXPECT_TRUE(t.starting());
    EXPECT_EQ(t.recent_bytes_s(1), estimate);
    EXPECT_EQ(t.recent_bytes_s(10), estimate);
    t.add(500, 0.25, {1, 700});
    EXPECT_EQ(t.recent_bytes_s(10), 800) << "more have ended than are under way";
    EXPECT_FALSE(t.starting());
  }
}

TEST(Throughput, RecentTransfersCountByTheirBytes) {
  EXPECT_DOUBLE_EQ(of({{500, 1}, {900, 3}}).recent_bytes_s(1), 300);
  EXPECT_DOUBLE_EQ(of({{9, 9}, {500, 1}, {900, 3}}).recent_bytes_s(2), 350);
  EXPECT_DOUBLE_EQ(of({{1000, 1}, {1000, 1}, {3000, 1}}).recent_bytes_s(100), 5000.0 / 3);
  EXPECT_TRUE(std::isfinite(of({{100, 0}}).recent_bytes_s(1)));
}

TEST(Throughput, TheMeanOfATimeCutsTransfersWhereItBegins) {
  const Throughput t = of({{100, 1}, {600, 2}, {50, 1}});
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(0.5), 50);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(1), 50);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(2), (50 + 300) / 2.0);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(4), 750 / 4.0);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(8), (750 + 4 * 1000) / 8.0);  // before the first: beta_0
  EXPECT_GE(t.mean_bytes_s(1e-300), 0);
}

}  // namespace texmesh::throughput_test
