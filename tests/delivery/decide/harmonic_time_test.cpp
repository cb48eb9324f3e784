// The plan of Harmonic Time Compensation: identities, limits, orders, policies, windows.
#include "delivery/cpp/decide/harmonic_time.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "delivery/cpp/decide/htc_theorem.h"
#include "delivery/cpp/simulate/simulation.h"
#include "tests/delivery/decide/some_offers.h"

namespace texmesh {
namespace {

using testing::some_offers;

double planned(const std::vector<FragmentOffer>& offers) {
  double sum = 0;
  for (const FragmentOffer& f : offers) sum += f.planned_bytes;
  return sum;
}
HtcOptions serial(double limit_s, double beta0) {
  HtcOptions o;
  o.time_limit_s = limit_s;
  o.throughput.initial_bytes_s = beta0;
  o.window = 1;
  return o;
}
double constant_run(const std::vector<FragmentOffer>& offers, const HtcOptions& o, double bytes_s) {
  return simulate_samples(offers, o, [&](std::size_t, double) { return bytes_s; }).end_s;
}

TEST(HarmonicTime, SurplusIsTheLastResidualAndTheCorrectedBoundHolds) {
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    const std::size_t n = 2 + seed % 60;
    const std::vector<FragmentOffer> offers = some_offers(n, seed);
    const double rate = 1e4, limit = planned(offers) / rate;
    HtcOptions o = serial(limit, rate * (0.5 + 0.001 * static_cast<double>(seed)));
    o.order = static_cast<HtcOrder>(seed % 3);
    const BandwidthTrace samples =
        random_trace(rate, 0.05 * static_cast<double>(seed % 20), 0.5, 1, 100, seed);
    HarmonicTimePlan plan(offers, o);
    double now = 0;
    while (const HtcStep* step = plan.next(now)) {
      now += step->bytes / samples.bytes_s[step->position];
      plan.completed(step->offer, now);
    }
    ASSERT_TRUE(plan.finished());
    const HtcTheorem t = theorem_of(plan);
    ASSERT_NEAR(t.surplus_s, t.last_residual_s, 1e-9 * limit) << seed;
    ASSERT_NEAR(t.surplus_s, limit - now, 1e-12 * limit);
    ASSERT_NEAR(plan.unspent_s(), t.surplus_s, 1e-9 * limit);
    ASSERT_LE(std::abs(t.surplus_s), t.corrected_bound_s * (1 + 1e-9) + 1e-9 * limit) << seed;
  }
}

TEST(HarmonicTime, EveryFragmentIsDecidedOnceAndTheMeanOneFirst) {
  const std::vector<FragmentOffer> offers = some_offers(50);
  double mean = 0;
  for (const FragmentOffer& f : offers) mean += f.eta / 50;
  for (const HtcOrder order : {HtcOrder::kCredit, HtcOrder::kBeta0, HtcOrder::kFinest}) {
    HtcOptions o = serial(planned(offers) / 1e4, 1e4);
    o.order = order;
    const SimulationResult r =
        simulate_samples(offers, o, [](std::size_t k, double) { return k % 2 ? 8e3 : 12e3; });
    ASSERT_EQ(r.steps.size(), 50u);
    std::vector<int> seen(50, 0);
    for (const HtcStep& s : r.steps) ++seen[s.offer];
    EXPECT_EQ(*std::min_element(seen.begin(), seen.end()), 1);
    for (const FragmentOffer& f : offers)
      EXPECT_LE(std::abs(offers[r.steps[0].offer].eta - mean), std::abs(f.eta - mean));
  }
}

TEST(HarmonicTime, CreditsOfOneRunAreThoseWorkedByHand) {
  // Four fragments of 1000 bytes, a second each at beta_0. Algorithm 4.1 on paper:
  // k = 1: the mean one (eta 0.6) at 800 bytes/s takes 1.25 s. dT = -1/4, zeta = 1/2 + 1/3 + 1/4 = 13/12.
  // k = 2: credit -1/4 / (2 x 13/12) = -3/26 < 0, so the finest. theta = 23/26, beta = 800: 707.7 bytes, 700
  //        is nearest. At 1000 bytes/s 0.7 s: dT = 12/65, zeta = 1/2 + 1/3 = 5/6.
  // k = 3: credit -1/4 / (3 x 13/12) + 12/65 / (2 x 5/6) = 11/325 > 0, so the coarsest. theta = 336/325, 1000
  //        bytes, at 500 bytes/s 2 s: dT = -314/325, zeta = 1/2.
  // k = 4: credit -1/4 / (4 x 13/12) + 12/65 / (3 x 5/6) - 314/325 / (2 x 1/2) = -19/20. theta = 1/20: 25 of
  //        the 500 bytes/s, so the lowest rung, at 1000 bytes/s 0.1 s: dT = -1/20 = Pi.
  std::vector<FragmentOffer> offers(4);
  const double etas[]{0.9, 0.6, 0.3, 0.1};
  for (std::size_t i = 0; i < 4; ++i) {
    offers[i].eta = etas[i];
    offers[i].planned_bytes = 1000;
    offers[i].loss.push_back(1);
    for (std::uint32_t r = 1; r <= 20; ++r) {
      offers[i].bytes.push_back(100 * r);
      offers[i].loss.push_back(1.0 / (1 + r));
    }
  }
  HtcOptions o = serial(4, 1000);
  o.hard_limits = true;
  const double rates[]{800, 1000, 500, 1000};
  const SimulationResult r = simulate_samples(offers, o, [&](std::size_t k, double) { return rates[k - 1]; });
  ASSERT_EQ(r.steps.size(), 4u);
  const std::uint32_t order[]{1, 0, 3, 2}, bytes[]{1000, 700, 1000, 100};
  const double credit[]{0, -3.0 / 26, 11.0 / 325, -19.0 / 20},
      residual[]{-1.0 / 4, 12.0 / 65, -314.0 / 325, -1.0 / 20};
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_EQ(r.steps[k].offer, order[k]) << k;
    EXPECT_EQ(r.steps[k].bytes, bytes[k]) << k;
    EXPECT_NEAR(r.steps[k].credit_s, credit[k], 1e-12) << k;
    EXPECT_NEAR(r.steps[k].theta_s, 1 + credit[k], 1e-12) << k;
    EXPECT_NEAR(r.steps[k].residual_s, residual[k], 1e-12) << k;
  }
  EXPECT_NEAR(r.end_s, 4.05, 1e-12);
  EXPECT_NEAR(r.deviation_percent, -1.25, 1e-9);
}

TEST(HarmonicTime, OrderFollowsTheSignOfTheCredit) {
  const std::vector<FragmentOffer> offers = some_offers(40);
  const auto second = [&](double rate) {
    const SimulationResult r = simulate_samples(offers, serial(planned(offers) / 1e4, 1e4),
                                                [&](std::size_t, double) { return rate; });
    EXPECT_EQ(r.steps[1].credit_s > 0, rate > 1e4);
    return offers[r.steps[1].offer].eta;
  };
  std::vector<double> etas;
  for (const FragmentOffer& f : offers) etas.push_back(f.eta);
  EXPECT_EQ(second(2e4), *std::min_element(etas.begin(), etas.end()));  // time to spare: the coarsest
  EXPECT_EQ(second(5e3), *std::max_element(etas.begin(), etas.end()));
}

TEST(HarmonicTime, MeetsItsLimitOnAnySteadyLink) {
  const std::vector<FragmentOffer> offers = some_offers(200);
  const double limit = planned(offers) / 1e4;
  for (const double rate : {3e3, 6e3, 1e4, 2e4, 4e4}) {
    const double end = constant_run(offers, serial(limit, 1e4), rate);
    EXPECT_NEAR(end, limit, 0.01 * limit) << rate;
  }
}

TEST(HarmonicTime, TheFirstOfTwoInFlightSaysNothingAgainstTheLink) {
  const std::vector<FragmentOffer> offers = some_offers(40);
  HtcOptions o;
  o.time_limit_s = 10;
  o.throughput.initial_bytes_s = planned(offers) / 10;
  HarmonicTimePlan plan(offers, o);
  const HtcStep first = *plan.next(0);
  const HtcStep second = *plan.next(0);
  ASSERT_EQ(plan.next(0), nullptr);
  // Both have half of the link.
  const double smaller = std::min(first.bytes, second.bytes);
  plan.completed(first.bytes < second.bytes ? first.offer : second.offer,
                 2 * smaller / o.throughput.initial_bytes_s);
  EXPECT_DOUBLE_EQ(plan.throughput_bytes_s(), o.throughput.initial_bytes_s);
}

TEST(HarmonicTime, ATenfoldDropIsMetByTheBottomOfTheLadderAndSkips) {
  const std::vector<FragmentOffer> offers = some_offers(256);
  const double limit = planned(offers) / 1e4;
  const BandwidthTrace drop{{0, 0.4 * limit}, {1e4, 1e3}};
  const BandwidthTrace stall{{0, 0.3 * limit, 0.6 * limit}, {1e4, 1, 1e4}};
  for (const Policy policy : {Policy::kHtc, Policy::kGuard}) {
    HtcOptions o = serial(limit, 1e4);
    o.policy = policy;
    EXPECT_LE(simulate_serial_trace(offers, o, drop).late_s, 0.005 * limit) << static_cast<int>(policy);
    EXPECT_LE(simulate_serial_trace(offers, o, stall).late_s, 0.005 * limit) << static_cast<int>(policy);
  }
  HtcOptions hard = serial(limit, 1e4);
  hard.hard_limits = true;
  std::vector<FragmentOffer> limited = offers;
  for (FragmentOffer& f : limited) f.low_rung = 2;
  const SimulationResult r = simulate_serial_trace(limited, hard, drop);
  EXPECT_EQ(r.skipped, 0u);
  for (const std::int32_t rung : r.rungs) EXPECT_GE(rung, 2);
  EXPECT_GT(r.late_s, 0.5 * limit);  // what limits cost that are none
}

TEST(HarmonicTime, RungsThatShowLessThanThePreviewAreNotAskedFor) {
  std::vector<FragmentOffer> offers = some_offers(128);
  for (FragmentOffer& f : offers) f.loss[0] = 0.2;  // rungs 0 and 1 lose 0.5 and 0.25
  const double limit = planned(offers) / 1e4;
  for (const Policy policy : {Policy::kHtc, Policy::kGuard, Policy::kPrice}) {
    HtcOptions o = serial(limit, 2e3);
    o.policy = policy;
    const SimulationResult r = simulate_samples(offers, o, [](std::size_t, double) { return 2e3; });
    for (const std::int32_t rung : r.rungs) EXPECT_TRUE(rung < 0 || rung >= 2) << rung;
    EXPECT_LE(r.late_s, 0.02 * limit);
    EXPECT_LT(r.loss, 0.2 * 128) << "more is shown than the previews do";
  }
  HtcOptions hard = serial(limit, 2e3);
  hard.hard_limits = true;  // the thesis knows no previews
  const SimulationResult r = simulate_samples(offers, hard, [](std::size_t, double) { return 2e3; });
  EXPECT_EQ(*std::min_element(r.rungs.begin(), r.rungs.end()), 0);
}

TEST(HarmonicTime, TheStaticPolicyAdaptsToNothing) {
  const std::vector<FragmentOffer> offers = some_offers(100);
  HtcOptions o = serial(planned(offers) / 1e4, 1e4);
  o.policy = Policy::kStatic;
  const double end = constant_run(offers, o, 1e4);
  EXPECT_NEAR(constant_run(offers, o, 5e3), 2 * end, 1e-9);
}

TEST(HarmonicTime, TheStaticColumnOfTable42IsWhatSuchATransferLeaves) {
  const std::vector<FragmentOffer> offers = table_4_2_offers();
  for (const Table42Row& row : table_4_2({}, 1)) {
    HtcOptions o = serial(row.t0_s, row.beta0_kb_s * 1e3);
    o.policy = Policy::kStatic;
    const double end_s = constant_run(offers, o, 41.68e3);
    // Sizes are those of rungs, all together 1 % from the planned ones.
    EXPECT_NEAR(100 * (row.t0_s - end_s) / row.t0_s, row.static_percent, 1.5) << row.beta0_kb_s;
  }
}

/// What a policy loses and how punctual it is, over ten links with bursts.
struct BurstyRuns {
  double loss = 0, latest_s = 0, mean_deviation_percent = 0;
};
BurstyRuns bursty_runs(Policy policy, Estimator estimator, double limit_s) {
  constexpr int kLinks = 10;
  const std::vector<FragmentOffer> offers = some_offers(256);
  BurstyRuns sum;
  for (std::uint64_t seed = 1; seed <= kLinks; ++seed) {
    HtcOptions o = serial(limit_s, 1e4);
    o.policy = policy;
    o.throughput.estimator = estimator;
    const SimulationResult r =
        simulate_serial_trace(offers, o, random_trace(1e4, 0.9, 0.9, 0.1, 5 * limit_s, seed));
    sum.loss += r.loss;
    sum.latest_s = std::max(sum.latest_s, r.late_s);
    sum.mean_deviation_percent += std::abs(r.deviation_percent) / kLinks;
  }
  return sum;
}

TEST(HarmonicTime, PriceAndGuardLoseLessThanTheMethodOnABurstyLinkAndArePunctual) {
  const double limit_s = planned(some_offers(256)) / 1e4;
  const BurstyRuns htc = bursty_runs(Policy::kHtc, Estimator::kLast, limit_s);
  const BurstyRuns guard = bursty_runs(Policy::kGuard, Estimator::kLast, limit_s);
  const BurstyRuns price = bursty_runs(Policy::kPrice, Estimator::kHarmonic, limit_s);
  EXPECT_LT(price.loss, htc.loss);
  EXPECT_LE(price.latest_s, 0.02 * limit_s);
  EXPECT_LT(guard.loss, 0.95 * htc.loss);
  EXPECT_LT(guard.mean_deviation_percent, 0.2);
}

TEST(HarmonicTime, LimitsHoldWhileThereIsTimeForThem) {
  std::vector<FragmentOffer> offers = some_offers(100), limited = offers;
  double low = 0;
  for (FragmentOffer& f : limited) low += f.bytes[f.low_rung = 2];
  const HtcOptions o = serial(planned(offers) / 1e4, 1e4);
  const auto below = [&](const std::vector<FragmentOffer>& list, double rate) {
    const SimulationResult r =
        simulate_samples(list, o, [&](std::size_t k, double) { return k % 2 ? 0.7 * rate : 1.7 * rate; });
    return std::count_if(r.rungs.begin(), r.rungs.end(), [](std::int32_t rung) { return rung < 2; });
  };
  const double enough = 3 * low / o.time_limit_s;
  EXPECT_GT(below(offers, enough), 5);
  EXPECT_LE(below(limited, enough), 1);  // the last one may find its time spent
  EXPECT_GT(below(limited, 0.2 * enough), 20);
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
  EXPECT_FALSE(HarmonicTimePlan(offers, o).too_short_for_rtt());
  o.time_limit_s = 29 * o.rtt_s;
  EXPECT_TRUE(HarmonicTimePlan(offers, o).too_short_for_rtt());
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
      simulate_samples(some_offers(1), serial(1, 1e4), [](std::size_t, double) { return 1e4; });
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
  refused([](auto&, HtcOptions& o) { o.throughput.initial_bytes_s = 0; });
  refused([](auto&, HtcOptions& o) { o.rtt_s = -1; });
  refused([](auto&, HtcOptions& o) { o.guard = 1; });
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
  HtcOptions o = serial(10, 100);  // D_1 = 1000
  o.policy = Policy::kThesis;
  o.order = HtcOrder::kBeta0;
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

TEST(HarmonicTime, AsPrintedAListThatDoesNotMatchLeavesTime) {
  const std::vector<FragmentOffer> offers = some_offers(40);
  const double rate = 2 * planned(offers) / 10;  // the link could carry twice the list
  HtcOptions o = serial(10, rate);
  o.policy = Policy::kThesis;
  EXPECT_NEAR(constant_run(offers, o, rate), 5, 0.5);
  o.policy = Policy::kHtc;
  EXPECT_NEAR(constant_run(offers, o, rate), 10, 0.5);
}

}  // namespace
}  // namespace texmesh
