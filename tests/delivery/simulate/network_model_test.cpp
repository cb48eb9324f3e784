// The model of a network: exact times for what can be worked out by hand.

#include <gtest/gtest.h>

#include <stdexcept>

#include "delivery/cpp/simulate/simulation.h"
#include "format/base/errors.h"
#include "tests/delivery/made_links.h"

namespace texmesh::network_model_test {

NetworkOptions link(double bytes_s) {
  NetworkOptions o;
  o.link = BandwidthTrace::constant(bytes_s);
  return o;
}
double arrival(NetworkModel& model, std::uint32_t expected) {
  const auto a = model.advance(1e6);
  EXPECT_TRUE(a.has_value());
  EXPECT_EQ(a->request, expected);
  return a->time_s;
}

TEST(NetworkModel, OneTransferTakesLatencyAndBytesOverRate) {
  NetworkOptions o = link(1000);
  o.rtt_s = 0.25;
  NetworkModel model(o);
  model.request(7, 0, 500);
  EXPECT_DOUBLE_EQ(arrival(model, 7), 0.75);
  o.connect_costs = true;
  NetworkModel handshake(o);
  handshake.request(1, 0, 500);
  EXPECT_DOUBLE_EQ(arrival(handshake, 1), 1.0);
  handshake.request(2, 0, 500);  // on the same connection
  EXPECT_DOUBLE_EQ(arrival(handshake, 2), 1.75);
}

TEST(NetworkModel, TransfersShareTheLink) {
  NetworkModel model(link(1000));
  model.request(0, 0, 1000);
  model.request(1, 0, 500);
  EXPECT_NEAR(arrival(model, 1), 1.0, 1e-9);  // 500 each
  EXPECT_NEAR(arrival(model, 0), 1.5, 1e-9);  // then alone
}

TEST(NetworkModel, TracesStepAndMayStall) {
  NetworkOptions o;
  o.link = {{0, 1, 3}, {1000, 0, 500}};
  NetworkModel model(o);
  model.request(0, 0, 1500);
  EXPECT_FALSE(model.advance(2.5).has_value());
  EXPECT_DOUBLE_EQ(model.now_s(), 2.5);
  EXPECT_NEAR(arrival(model, 0), 4.0, 1e-9);
  EXPECT_DOUBLE_EQ(o.link.mean(0, 4), 375);
}

TEST(NetworkModel, ConnectionsAreLimited) {
  NetworkOptions o = link(1000);
  o.rtt_s = 1;
  o.connections = 1;
  NetworkModel model(o);
  model.request(0, 0, 1000);
  model.request(1, 0, 1000);
  EXPECT_NEAR(arrival(model, 0), 2, 1e-9);
  EXPECT_NEAR(arrival(model, 1), 4, 1e-9);  // asked when the first was done
}

TEST(NetworkModel, SlowStartLossAndMirrors) {
  NetworkOptions o = link(1e9);
  o.rtt_s = 0.1;
  o.slow_start = true;
  NetworkModel slow(o);
  slow.request(0, 0, 14600 + 29200);
  EXPECT_NEAR(arrival(slow, 0), 0.3, 1e-6);  // one round trip to ask, then windows of 10 and 20 packets
  o.slow_start = false;
  o.loss = 0.02;
  NetworkModel lossy(o);
  lossy.request(0, 0, 1e6);
  EXPECT_GT(arrival(lossy, 0), 0.5);  // about 14 losses, a round trip each
  NetworkOptions m = link(2000);
  m.mirrors = {{BandwidthTrace::constant(500), 1e300}, {BandwidthTrace::constant(1e9), 1e300}};
  NetworkModel mirrors(m);
  mirrors.request(0, 0, 500);
  mirrors.request(1, 1, 1500);
  EXPECT_NEAR(arrival(mirrors, 0), 1, 1e-9);
  EXPECT_NEAR(arrival(mirrors, 1), 1, 1e-9);  // what the slow one cannot use
}

TEST(NetworkModel, CancelledRequestsFreeTheirConnection) {
  NetworkOptions o = link(1000);
  o.connections = 1;
  NetworkModel model(o);
  model.request(0, 0, 1e9);
  model.request(1, 0, 1000);
  model.advance(1);
  model.cancel(0);
  EXPECT_NEAR(arrival(model, 1), 2, 1e-9);
}

TEST(NetworkModel, ADeadMirrorIsReplaced) {
  std::vector<FragmentOffer> offers = testing::photo_offers();
  HtcOptions o;
  o.time_limit_s = 10;
  o.initial_bytes_s = 41.68e3;
  o.rtt_s = 0.02;
  NetworkOptions network = link(41.68e3);
  network.rtt_s = 0.02;
  network.mirrors = {{BandwidthTrace::constant(1e9), 3.0}, {BandwidthTrace::constant(1e9), 1e300}};
  const SimulationResult r = simulate(offers, o, network);
  EXPECT_LT(r.late_s, 0.5);
  EXPECT_EQ(r.steps.size(), offers.size());
  for (const HtcStep& s : r.steps) EXPECT_GE(s.done_s, 0);
  network.mirrors = {{BandwidthTrace::constant(2e3), 1e300}, {BandwidthTrace::constant(1e9), 1e300}};
  EXPECT_LT(simulate(offers, o, network).late_s, 0.3);  // one slow mirror
}

TEST(NetworkModel, RefusesNonsense) {
  EXPECT_THROW(NetworkModel(link(0)), std::invalid_argument);
  NetworkOptions o = link(1);
  o.mirrors.clear();
  EXPECT_THROW(NetworkModel{o}, std::invalid_argument);
  o = link(1);
  o.loss = 0.9;
  EXPECT_THROW(NetworkModel{o}, std::invalid_argument);
  NetworkModel model(link(1));
  EXPECT_THROW(model.request(0, 1, 1), std::invalid_argument);
}

TEST(BandwidthTrace, CsvIsReadOrItsLineIsNamed) {
  const BandwidthTrace t =
      read_trace_csv("seconds,bytes per second\n# a comment\n0,1000\r\n\n2.5, 400\n", "t.csv");
  EXPECT_EQ(t.time_s, (std::vector<double>{0, 2.5}));
  EXPECT_EQ(t.bytes_s, (std::vector<double>{1000, 400}));
  for (const char* bad :
       {"", "a,b\nc,d\n0,1", "1,5", "0,1\n0,2", "0,-1", "0,0", "0,1e99", "0", "0,1,2", "0,nan"}) {
    try {
      read_trace_csv(bad, "t.csv");
      ADD_FAILURE() << bad;
    } catch (const InputError& e) {
      EXPECT_NE(std::string(e.what()).find("t.csv"), std::string::npos);
    }
  }
}

}  // namespace texmesh::network_model_test
