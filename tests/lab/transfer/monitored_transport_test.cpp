// Test packets beside a transfer, over the model of a network.
#include "lab/transfer/probes.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lab/transfer/chapter_4.h"
#include "lab/transfer/policies.h"

namespace texmesh::monitored_transport_test {

NetworkOptions link(double bytes_s) {
  NetworkOptions n;
  n.link = BandwidthTrace::constant(bytes_s);
  n.rtt_s = 0.02;
  return n;
}
HtcOptions options() {
  HtcOptions o = options_of({});
  o.time_limit_s = 8;
  o.initial_bytes_s = 5e4;
  o.rtt_s = 0.02;
  return o;
}

TEST(MonitoredTransport, PacketsMeasureTheWholeLinkAndCostTheirBytes) {
  const NetworkOptions network = link(5e4);
  const SimulationResult plain = simulate(table_4_2_offers(), options(), network);
  ProbeResult probes;
  const SimulationResult probed = simulate_with_probes(table_4_2_offers(), options(), network,
                                                       {ProbeMode::kFixed, 4000, 0.5, 1e5}, probes);
  EXPECT_NEAR(probes.packets, 16, 2);
  EXPECT_EQ(probes.bytes, 4000u * probes.packets);
  EXPECT_GE(probes.samples.size() + 1, probes.packets);
  double mean = 0;
  for (const BandwidthSample& s : probes.samples) {
    mean += s.bytes_s / static_cast<double>(probes.samples.size());
    EXPECT_LE(s.bytes_s, 5e4 * 1.4);  // the first bytes of others' round trips count, too
  }
  EXPECT_NEAR(mean, 5e4, 0.15 * 5e4);
  EXPECT_LE(std::abs(probed.deviation_percent), 2);
  EXPECT_LT(probed.bytes, plain.bytes - probes.bytes / 2);  // the time is the same, the link is shared
}

TEST(MonitoredTransport, SendsNothingWhileOffAndEndsWithDeadServers) {
  NetworkOptions network = link(5e4);
  const SimulationResult plain = simulate(table_4_2_offers(), options(), network);
  ProbeResult none;
  const SimulationResult off =
      simulate_with_probes(table_4_2_offers(), options(), network, {ProbeMode::kOff, 64, 0.01, 1}, none);
  EXPECT_EQ(none.packets, 0u);
  EXPECT_EQ(plain.end_s, off.end_s);
  EXPECT_EQ(plain.rungs, off.rungs);
  network.mirrors = {{BandwidthTrace::constant(1e6), 1.0}};
  ProbeResult probes;
  const SimulationResult dead = simulate_with_probes(table_4_2_offers(), options(), network,
                                                     {ProbeMode::kAdaptive, 500, 0.1, 1e5}, probes);
  EXPECT_TRUE(dead.never);
  EXPECT_LE(probes.samples.size() + 1, probes.packets);  // the last one never came
}

}  // namespace texmesh::monitored_transport_test
