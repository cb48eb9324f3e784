// Test packets beside a transfer, over the model of a network.
#include "delivery/cpp/transfer/monitored_transport.h"

#include <gtest/gtest.h>

#include <cmath>

#include "delivery/cpp/simulate/simulation.h"

namespace texmesh {
namespace {

NetworkOptions link(double bytes_s) {
  NetworkOptions n;
  n.link = BandwidthTrace::constant(bytes_s);
  n.rtt_s = 0.02;
  return n;
}
HtcOptions options() {
  HtcOptions o;
  o.time_limit_s = 8;
  o.throughput.initial_bytes_s = 5e4;
  o.rtt_s = 0.02;
  return o;
}

TEST(MonitoredTransport, PacketsMeasureTheWholeLinkAndCostTheirBytes) {
  const NetworkOptions network = link(5e4);
  const SimulationResult plain = simulate(table_4_2_offers(), options(), network);
  const SimulationResult probed =
      simulate(table_4_2_offers(), options(), network, {ProbeMode::kFixed, 4000, 0.5, 1e5});
  EXPECT_EQ(plain.probes, 0u);
  EXPECT_NEAR(probed.probes, 16, 2);
  EXPECT_EQ(probed.probe_bytes, 4000u * probed.probes);
  EXPECT_GE(probed.samples.size() + 1, probed.probes);
  double mean = 0;
  for (const BandwidthSample& s : probed.samples) {
    mean += s.bytes_s / static_cast<double>(probed.samples.size());
    EXPECT_LE(s.bytes_s, 5e4 * 1.4);  // the first bytes of others' round trips count, too
  }
  EXPECT_NEAR(mean, 5e4, 0.15 * 5e4);
  EXPECT_LE(std::abs(probed.deviation_percent), 2);
  EXPECT_LT(probed.bytes, plain.bytes - probed.probe_bytes / 2);  // the time is the same, the link is shared
}

TEST(MonitoredTransport, SendsNothingWhileOffAndEndsWithDeadServers) {
  NetworkOptions network = link(5e4);
  const SimulationResult plain = simulate(table_4_2_offers(), options(), network);
  const SimulationResult off =
      simulate(table_4_2_offers(), options(), network, {ProbeMode::kOff, 64, 0.01, 1});
  EXPECT_EQ(plain.end_s, off.end_s);
  EXPECT_EQ(plain.rungs, off.rungs);
  network.mirrors = {{BandwidthTrace::constant(1e6), 1.0}};
  const SimulationResult dead =
      simulate(table_4_2_offers(), options(), network, {ProbeMode::kAdaptive, 500, 0.1, 1e5});
  EXPECT_TRUE(dead.never);
  EXPECT_LE(dead.samples.size() + 1, dead.probes);  // the last one never came
}

}  // namespace
}  // namespace texmesh
