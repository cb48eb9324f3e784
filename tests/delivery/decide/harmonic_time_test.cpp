// The plan of Harmonic Time Compensation with the policies of clients: limits, windows, failures, chapter 4
// by hand.
#include "delivery/cpp/decide/harmonic_time.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <memory>
#include <stdexcept>

#include "delivery/cpp/simulate/simulation.h"
#include "tests/delivery/decide/some_offers.h"

namespace texmesh::harmonic_time_test {

using testing::some_offers;

double planned(const std::vector<FragmentOffer>& offers) {
  double sum = 0;
  for (const FragmentOffer& f : offers) sum += f.planned_bytes;
  return sum;
}
HtcOptions serial(double limit_s, double beta0, Policy policy = Policy::kGuard) {
  HtcOptions o;
  o.policy = policy;
  o.time_limit_s = limit_s;
  o.initial_bytes_s = beta0;
  o.window = 1;
  return o;
}
/// One request at a time; transfer k at the rate `rate(k)`.
SimulationResult simulate_samples(const std::vector<FragmentOffer>& offers, const HtcOptions& options,
                                  const std::function<double(std::size_t)>& rate) {
  HarmonicTimePlan plan(offers, options);
  double now_s = 0;
  while (const HtcStep* step = plan.next(now_s)) {
    now_s += step->bytes / rate(step->position);
    plan.completed(step->offer, now_s);
  }
  EXPECT_TRUE(plan.finished());
  EXPECT_NEAR(plan.unspent_s(), plan.surplus_s(), 1e-9 * options.time_limit_s);
  return result_of(plan, options.time_limit_s, now_s);
}
SimulationResult simulate_serial(const std::vector<FragmentOffer>& offers, const HtcOptions& options,
                                 const BandwidthTrace& link) {
  NetworkOptions network;
  network.link = link;
  network.connections = 1;
  return simulate(offers, options, network);
}

TEST(HarmonicTime, EveryFragmentIsDecidedOnceAndTheMeanOneFirst) {
  const std::vector<FragmentOffer> offers = some_offers(50);
  double mean = 0;
  for (const FragmentOffer& f : offers) mean += f.eta / 50;
  for (const Policy policy : {Policy::kGuard, Policy::kThesis}) {
    const SimulationResult r = simulate_samples(offers, serial(planned(offers) / 1e4, 1e4, policy),
                                                [](std::size_t k) { return k % 2 ? 8e3 : 12e3; });
    ASSERT_EQ(r.steps.size(), 50u);
    std::vector<int> seen(50, 0);
    for (const HtcStep& s : r.steps) ++seen[s.offer];
    EXPECT_EQ(*std::min_element(seen.begin(), seen.end()), 1);
    const double middle = policy == Policy::kThesis ? 0 : mean;  // etas count from Gamma
    for (const FragmentOffer& f : offers)
      EXPECT_LE(std::abs(offers[r.steps[0].offer].eta - middle), std::abs(f.eta - middle));
  }
}

TEST(HarmonicTime, MeetsItsLimitOnAnySteadyLink) {
  const std::vector<FragmentOffer> offers = some_offers(200);
  const double limit = planned(offers) / 1e4;
  for (const double rate : {3e3, 6e3, 1e4, 2e4, 4e4}) {
    const SimulationResult r =
        simulate_samples(offers, serial(limit, 1e4), [&](std::size_t) { return rate; });
    EXPECT_NEAR(r.end_s, limit, 0.01 * limit) << rate;
  }
}

TEST(HarmonicTime, TheFirstOfTwoInFlightSaysNothingAgainstTheLink) {
  const std::vector<FragmentOffer> offers = some_offers(40);
  HtcOptions o;
  o.time_limit_s = 10;
  o.initial_bytes_s = planned(offers) / 10;
  HarmonicTimePlan plan(offers, o);
  const HtcStep first = *plan.next(0);
  const HtcStep second = *plan.next(0);
  ASSERT_EQ(plan.next(0), nullptr);
  // Both have half of the link.
  const double smaller = std::min(first.bytes, second.bytes);
  plan.completed(first.bytes < second.bytes ? first.offer : second.offer, 2 * smaller / o.initial_bytes_s);
  EXPECT_DOUBLE_EQ(plan.throughput_bytes_s(), o.initial_bytes_s);
}

TEST(HarmonicTime, ATenfoldDropIsMetByTheBottomOfTheLadderAndSkips) {
  const std::vector<FragmentOffer> offers = some_offers(256);
  const double limit = planned(offers) / 1e4;
  const BandwidthTrace drop{{0, 0.4 * limit}, {1e4, 1e3}};
  const BandwidthTrace stall{{0, 0.3 * limit, 0.6 * limit}, {1e4, 1, 1e4}};
  for (const BandwidthTrace& link : {drop, stall})
    EXPECT_LE(simulate_serial(offers, serial(limit, 1e4), link).late_s, 0.005 * limit);
  testing::expect_hard_limits_cost(offers, serial(limit, 1e4, Policy::kThesis), drop, simulate_serial);
}

TEST(HarmonicTime, RungsThatShowLessThanThePreviewAreNotAskedFor) {
  std::vector<FragmentOffer> offers = some_offers(128);
  for (FragmentOffer& f : offers) f.loss[0] = 0.2;  // rungs 0 and 1 lose 0.5 and 0.25
  const double limit = planned(offers) / 1e4;
  const SimulationResult r = simulate_samples(offers, serial(limit, 2e3), [](std::size_t) { return 2e3; });
  for (const std::int32_t rung : r.rungs) EXPECT_TRUE(rung < 0 || rung >= 2) << rung;
  EXPECT_LE(r.late_s, 0.02 * limit);
  EXPECT_LT(r.loss, 0.2 * 128) << "more is shown than the previews do";
  HtcOptions hard = serial(limit, 2e3);
  hard.hard_limits = true;  // the thesis knows no previews
  const SimulationResult printed = simulate_samples(offers, hard, [](std::size_t) { return 2e3; });
  EXPECT_EQ(*std::min_element(printed.rungs.begin(), printed.rungs.end()), 0);
}

TEST(HarmonicTime, AnotherPolicyMayDecide) {
  struct Finest final : TransferPolicy {
    std::int32_t rung(const HarmonicTimePlan&, std::uint32_t, double, double) const override { return 7; }
    bool begins_with_mean() const override { return false; }
    bool finest_is_next(const HarmonicTimePlan&, double) const override { return true; }
  };
  HtcOptions o = serial(1, 1e4);
  o.other_policy = [] { return std::make_unique<Finest>(); };
  const std::vector<FragmentOffer> offers = some_offers(9);
  const SimulationResult r = simulate_samples(offers, o, [](std::size_t) { return 1e4; });
  for (std::size_t k = 0; k + 1 < r.steps.size(); ++k)
    EXPECT_GE(offers[r.steps[k].offer].eta, offers[r.steps[k + 1].offer].eta);
  EXPECT_EQ(r.rungs, std::vector<std::int32_t>(9, 7));
}

TEST(HarmonicTime, TheWindowHidesRoundTrips) {
  const std::vector<FragmentOffer> offers = some_offers(256);
  const double limit = planned(offers) / 1e4;
  NetworkOptions network;
  network.link = BandwidthTrace::constant(1e4);
  network.rtt_s = 0.01 * limit;
  HtcOptions o = serial(limit, 1e4);
  o.rtt_s = network.rtt_s;
  o.window = 0;
  const SimulationResult with = simulate(offers, o, network);
  EXPECT_NEAR(with.end_s, limit, 0.02 * limit);
  o.window = 1;
  const SimulationResult without = simulate(offers, o, network);
  EXPECT_LT(with.loss, without.loss);
}

TEST(HarmonicTime, FailuresCountAsSkippedAndTheirTimeIsSpent) {
  const std::vector<FragmentOffer> offers = some_offers(20);
  HarmonicTimePlan plan(offers, serial(planned(offers) / 1e4, 1e4));
  double now = 0;
  std::uint32_t failures = 0;
  while (const HtcStep* step = plan.next(now)) {
    now += step->bytes / 1e4;
    const std::uint32_t offer = step->offer;
    if (step->position % 5 == 0)
      plan.failed(offer, now), ++failures;
    else
      plan.completed(offer, now);
  }
  EXPECT_TRUE(plan.finished());
  std::uint32_t skipped = 0;
  for (const std::int32_t r : plan.rungs()) skipped += r < 0;
  EXPECT_GE(skipped, failures);
  EXPECT_GT(failures, 0u);
  EXPECT_NEAR(plan.surplus_s(), plan.unspent_s(), 1e-9);
}

TEST(HarmonicTime, NothingToSendAndOneFragment) {
  HarmonicTimePlan none({}, serial(1, 1e4));
  EXPECT_EQ(none.next(0), nullptr);
  EXPECT_TRUE(none.finished());
  const SimulationResult one =
      simulate_samples(some_offers(1), serial(1, 1e4), [](std::size_t) { return 1e4; });
  EXPECT_EQ(one.steps.size(), 1u);
  EXPECT_EQ(one.skipped, 0u);
}

TEST(HarmonicTime, RefusesWhatItCannotPlan) {
  const auto refused = [](auto&& bend) {
    std::vector<FragmentOffer> offers = some_offers(3);
    HtcOptions o = serial(1, 1e4);
    bend(offers, o);
    EXPECT_THROW(HarmonicTimePlan(offers, o), std::invalid_argument);
  };
  refused([](auto&, HtcOptions& o) { o.time_limit_s = 0; });
  refused([](auto&, HtcOptions& o) { o.time_limit_s = std::nan(""); });
  refused([](auto&, HtcOptions& o) { o.initial_bytes_s = 0; });
  refused([](auto&, HtcOptions& o) { o.rtt_s = -1; });
  refused([](auto& offers, HtcOptions&) { offers[1].bytes.clear(); });
  refused([](auto& offers, HtcOptions&) { offers[1].loss.pop_back(); });
  refused([](auto& offers, HtcOptions&) { offers[1].planned_bytes = 0; });
  refused([](auto& offers, HtcOptions&) { offers[1].bytes[2] = 0; });
  refused([](auto& offers, HtcOptions&) { offers[1].eta = INFINITY; });
  HarmonicTimePlan plan(some_offers(3), serial(1, 1e4));
  EXPECT_THROW(plan.completed(0, 1), std::invalid_argument);
  const std::uint32_t first = plan.next(0)->offer;
  plan.completed(first, 1);
  EXPECT_THROW(plan.completed(first, 2), std::invalid_argument);
}

/// (4.1) to (4.8) by hand: four fragments, rungs so fine that every size can be had.
TEST(HarmonicTime, AsPrintedTheTimesAreThoseOfTheBytesAtBeta0) {
  std::vector<FragmentOffer> offers(4);
  const double etas[]{0.5, 0.1, -0.05, -0.4}, sizes[]{400, 300, 200, 100};
  for (std::size_t i = 0; i < 4; ++i) {
    offers[i].eta = etas[i];  // less Gamma: offer 2 is F-bar
    offers[i].planned_bytes = sizes[i];
    offers[i].loss.push_back(1);
    for (std::uint32_t b = 1; b <= 2000; ++b) offers[i].bytes.push_back(b), offers[i].loss.push_back(0.5);
  }
  HtcOptions o = serial(10, 100, Policy::kThesis);  // D_1 = 1000
  o.hard_limits = true;
  HarmonicTimePlan plan(offers, o);
  const HtcStep* first = plan.next(0);
  ASSERT_NE(first, nullptr);
  EXPECT_EQ(first->offer, 2u);
  EXPECT_EQ(first->bytes, 200u);
  EXPECT_NEAR(first->theta_s, 2, 1e-12);  // d_1 / beta_0
  plan.completed(2, 2.5);                 // beta_1 = 80: late by 0.5 s
  const HtcStep* second = plan.next(2.5);
  EXPECT_EQ(second->offer, 0u) << "beta_1 <= beta_0: the leftmost";
  const double zeta = 1.0 / 2 + 1.0 / 3 + 1.0 / 4;
  EXPECT_NEAR(second->theta_s, 4 - 0.5 / (2 * zeta), 1e-12);
  EXPECT_EQ(second->bytes, static_cast<std::uint32_t>(std::lround(80 * second->theta_s)));
  const double gamma_2 = 2;  // beta_2 is above beta_0
  plan.completed(0, 2.5 + gamma_2);
  const HtcStep* third = plan.next(2.5 + gamma_2);
  EXPECT_EQ(third->offer, 3u) << "beta_2 > beta_0: the rightmost";
  const double credit = -0.5 / (3 * zeta) + (second->theta_s - gamma_2) / (2 * (1.0 / 2 + 1.0 / 3));
  EXPECT_NEAR(third->theta_s, 1 + credit, 1e-12);
}

}  // namespace texmesh::harmonic_time_test
