// A link as a trace: what was carried is what is played again.
#include "delivery/cpp/simulate/link_recorder.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh {
namespace {

TEST(LinkRecorder, StepsOfALinkComeBack) {
  // 1000 bytes/s for two seconds, 4000 for one, nothing for one, 500 for the last; a round trip of 0.2 s
  // before.
  LinkRecorder r;
  r.asked(10);
  const double rate[]{1000, 1000, 4000, 0, 500};
  for (int s = 0; s < 5; ++s)
    for (int i = 1; i <= 10; ++i)
      if (rate[s] > 0) r.received(10.2 + s + 0.1 * i, rate[s] * 0.1);
  r.ended(15.2);
  const auto trace = r.trace(0.2, 0.5);
  ASSERT_TRUE(trace.has_value());
  EXPECT_EQ(trace->time_s.front(), 0);
  EXPECT_NEAR(trace->at(0.1), 1000, 1);
  for (double t = 0; t < 1.9; t += 0.1) EXPECT_NEAR(trace->at(t), 1000, 1) << t;
  EXPECT_NEAR(trace->at(2.6), 4000, 500);
  EXPECT_NEAR(trace->at(4.9), 500, 5);
  EXPECT_NEAR(trace->mean(0.2, 5.2) * 5, r.bytes(), 0.1 * r.bytes());
  for (std::size_t i = 1; i < trace->time_s.size(); ++i) EXPECT_GT(trace->time_s[i], trace->time_s[i - 1]);
}

TEST(LinkRecorder, AnIdleLinkSaysNothing) {
  LinkRecorder r;
  for (const double start : {0.0, 5.0}) {  // two requests of a second each, with four seconds between them
    r.asked(start);
    for (int i = 1; i <= 10; ++i) r.received(start + 0.1 * i, 200);
    r.ended(start + 1);
  }
  const auto trace = r.trace(0, 0.25);
  ASSERT_TRUE(trace.has_value());
  for (double t = 0; t < 6; t += 0.1) EXPECT_NEAR(trace->at(t), 2000, 1) << t;
}

TEST(LinkRecorder, ABurstAndNothingAreTraces) {
  LinkRecorder r;
  EXPECT_FALSE(r.trace(0.1, 0.1).has_value());
  r.asked(1);
  EXPECT_FALSE(r.trace(0.1, 0.1).has_value());
  r.received(1, 5000);  // sooner than a round trip
  r.ended(1);
  const auto trace = r.trace(0.1, 0.1);
  ASSERT_TRUE(trace.has_value());
  EXPECT_EQ(trace->time_s.size(), 1u);
  EXPECT_GT(trace->bytes_s[0], 0);
  LinkRecorder stalled;  // ends with silence: the last rate is one that carries
  stalled.asked(0);
  stalled.received(1, 1000);
  stalled.received(9, 1);
  const auto with_stall = stalled.trace(0, 0.5);
  EXPECT_GT(with_stall->bytes_s.back(), 0);
  NetworkOptions o;
  o.link = *with_stall;
  EXPECT_NO_THROW(NetworkModel{o});
}

TEST(LinkRecorder, WrittenAndReadAgainItIsTheSame) {
  const BandwidthTrace trace{{0, 0.1, 1.0 / 3}, {12345.678, 0, 1e6 / 7}};
  const std::string csv = trace_csv(trace, "from a test\nof two lines");
  EXPECT_TRUE(csv.starts_with("# from a test\n# of two lines\nseconds,bytes per second\n"));
  const BandwidthTrace again = read_trace_csv(csv, "t.csv");
  EXPECT_EQ(again.time_s, trace.time_s);
  EXPECT_EQ(again.bytes_s, trace.bytes_s);
}

}  // namespace
}  // namespace texmesh
