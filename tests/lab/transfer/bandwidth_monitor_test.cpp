// Test packets: when they go out, how they adapt, what they show.
#include "lab/transfer/probes.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

namespace texmesh::bandwidth_monitor_test {

TEST(BandwidthMonitor, FixedPacketsGoOutAtRegularIntervals) {
  BandwidthMonitor m({ProbeMode::kFixed, 1000, 0.5, 1e5});
  EXPECT_EQ(m.next_s(), 0);
  EXPECT_EQ(m.send(0.1), 1000u);
  EXPECT_EQ(m.next_s(), BandwidthMonitor::kNever_s);  // one at a time
  m.arrived(0.35, 0.05, 1000);
  EXPECT_DOUBLE_EQ(m.next_s(), 0.6);
  ASSERT_EQ(m.samples().size(), 1u);
  EXPECT_NEAR(m.samples()[0].seconds, 0.2, 1e-12);
  EXPECT_NEAR(m.samples()[0].bytes_s, 5000, 1e-6);
  m.send(0.6);
  m.arrived(1.6, 0, 4000);  // 3000 of others came in that second, too
  EXPECT_NEAR(m.samples()[1].bytes_s, 4000, 1e-6);
  EXPECT_EQ(m.send(1.7), 1000u);
  m.lost();
  EXPECT_DOUBLE_EQ(m.next_s(), 2.2);
  EXPECT_EQ(m.sent(), 3u);
  EXPECT_EQ(m.sent_bytes(), 3000u);
  EXPECT_EQ(m.samples().size(), 2u);
}

TEST(BandwidthMonitor, AdaptivePacketsFollowTheThreshold) {
  BandwidthMonitor m({ProbeMode::kAdaptive, 1024, 1, 1000});
  const auto next = [&](double rate) {
    const double now = m.next_s();
    m.send(now);
    m.arrived(now + 20, 0, 20 * rate);
  };
  next(999);
  EXPECT_EQ(m.packet_bytes(), 512);
  EXPECT_EQ(m.interval_s(), 2);
  EXPECT_DOUBLE_EQ(m.next_s(), 2);  // the new interval counts from the packet that has changed it
  for (int i = 0; i < 6; ++i) next(10);
  EXPECT_EQ(m.packet_bytes(), 128);  // an eighth of the first, and no less
  EXPECT_EQ(m.interval_s(), 8);
  for (int i = 0; i < 9; ++i) next(1000);  // at the threshold is not below it
  EXPECT_EQ(m.packet_bytes(), 8192);
  EXPECT_EQ(m.interval_s(), 0.125);
}

TEST(BandwidthMonitor, OffSendsNothingAndNonsenseIsRefused) {
  EXPECT_EQ(BandwidthMonitor({}).next_s(), BandwidthMonitor::kNever_s);
  for (const ProbeOptions& bad :
       {ProbeOptions{ProbeMode::kFixed, 63, 1, 1}, ProbeOptions{ProbeMode::kFixed, 1e9, 1, 1},
        ProbeOptions{ProbeMode::kFixed, 1000, 0, 1}, ProbeOptions{ProbeMode::kFixed, 1000, 1, 0},
        ProbeOptions{ProbeMode::kFixed, NAN, 1, 1}, ProbeOptions{ProbeMode::kAdaptive, 1000, NAN, 1}})
    EXPECT_THROW(BandwidthMonitor{bad}, std::invalid_argument);
}

TEST(BandwidthMonitor, WhatComesWithinARoundTripIsNoInfiniteRate) {
  BandwidthMonitor m({ProbeMode::kFixed, 1000, 1, 1});
  m.send(0);
  m.arrived(0.01, 0.5, 1000);
  EXPECT_NEAR(m.samples()[0].bytes_s, 1000 / 0.002, 1e-6);
}

}  // namespace texmesh::bandwidth_monitor_test
