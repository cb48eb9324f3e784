// Estimates of throughput from transfers that have ended.
#include "delivery/cpp/decide/throughput.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh {
namespace {

Throughput of(std::initializer_list<std::pair<double, double>> samples, Estimator estimator) {
  Throughput t({estimator, 2, 0.5, 100, 1000});
  for (const auto& [bytes, seconds] : samples) t.add(bytes, seconds);
  return t;
}

TEST(Throughput, IsBeta0UntilThereIsASample) {
  for (const Estimator e : {Estimator::kLast, Estimator::kHarmonic, Estimator::kEwma}) {
    EXPECT_EQ(of({}, e).bytes_s(), 1000);
    EXPECT_EQ(of({}, e).recent_bytes_s(5), 1000);
    EXPECT_EQ(of({}, e).mean_bytes_s(3), 1000);
  }
}

TEST(Throughput, WhatElseIsUnderWayHasItsPartOfTheFirstSeconds) {
  for (const Estimator e : {Estimator::kLast, Estimator::kHarmonic, Estimator::kEwma}) {
    // Two of 500 bytes share a link: after a second one has ended, and nearly all of the other has come.
    for (const auto& [beta0, estimate] : {std::pair{100, 500}, {800, 800}, {5000, 1000}}) {
      Throughput t({e, 2, 0.5, 100, static_cast<double>(beta0)});
      t.add(500, 1, {1, 500});
      EXPECT_EQ(t.bytes_s(), estimate);
      EXPECT_EQ(t.recent_bytes_s(10), estimate);
      t.add(500, 0.25, {1, 700});
      EXPECT_EQ(t.recent_bytes_s(10), 800) << "more have ended than are under way";
    }
  }
}

TEST(Throughput, EstimatorsWeighSamplesAsTheySay) {
  EXPECT_DOUBLE_EQ(of({{500, 1}, {900, 3}}, Estimator::kLast).bytes_s(), 300);
  EXPECT_DOUBLE_EQ(of({{9, 9}, {500, 1}, {900, 3}}, Estimator::kHarmonic).bytes_s(), 350);
  EXPECT_DOUBLE_EQ(of({{500, 1}}, Estimator::kEwma).bytes_s(), 750);
  EXPECT_DOUBLE_EQ(of({{50, 0.1}}, Estimator::kEwma).bytes_s(), 875);  // half as large counts half
}

TEST(Throughput, TheMeanOfATimeCutsTransfersWhereItBegins) {
  const Throughput t = of({{100, 1}, {600, 2}, {50, 1}}, Estimator::kLast);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(0.5), 50);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(1), 50);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(2), (50 + 300) / 2.0);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(4), 750 / 4.0);
  EXPECT_DOUBLE_EQ(t.mean_bytes_s(8), (750 + 4 * 1000) / 8.0);  // before the first: beta_0
  EXPECT_GE(t.mean_bytes_s(1e-300), 0);
}

TEST(Throughput, Estimators) {
  ThroughputOptions o;
  o.initial_bytes_s = 100;
  for (const Estimator e : {Estimator::kLast, Estimator::kHarmonic, Estimator::kEwma}) {
    o.estimator = e;
    EXPECT_EQ(Throughput(o).bytes_s(), 100);
  }
  o.estimator = Estimator::kHarmonic;
  o.samples = 2;
  Throughput t(o);
  t.add(1000, 1);
  t.add(1000, 1);
  t.add(3000, 1);
  EXPECT_DOUBLE_EQ(t.bytes_s(), 2000);
  EXPECT_DOUBLE_EQ(t.recent_bytes_s(1), 3000);
  EXPECT_DOUBLE_EQ(t.recent_bytes_s(100), 5000.0 / 3);
  o.estimator = Estimator::kEwma;
  o.ewma = 0.5;
  o.small_bytes = 1000;
  Throughput ewma(o);
  ewma.add(1000, 1);
  EXPECT_DOUBLE_EQ(ewma.bytes_s(), 550);
  Throughput small(o);
  small.add(100, 0.1);  // the same rate, a tenth of the weight
  EXPECT_DOUBLE_EQ(small.bytes_s(), 145);
  small.add(100, 0);  // no time at all is no infinite rate for ever
  EXPECT_TRUE(std::isfinite(small.bytes_s()));
}

}  // namespace
}  // namespace texmesh
