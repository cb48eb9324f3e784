// Harmonic Time Compensation with every policy, order and estimator: identities, limits, Table 4.2.
#include "lab/transfer/policies.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>
#include <stdexcept>

#include "lab/transfer/chapter_4.h"
#include "tests/delivery/decide/some_offers.h"

namespace texmesh::policies_test {

using testing::some_offers;

double planned(const std::vector<FragmentOffer>& offers) {
  double sum = 0;
  for (const FragmentOffer& f : offers) sum += f.planned_bytes;
  return sum;
}
HtcOptions serial(double limit_s, double beta0, const LabOptions& method = {}) {
  HtcOptions o = options_of(method);
  o.time_limit_s = limit_s;
  o.initial_bytes_s = beta0;
  o.window = 1;
  return o;
}
double constant_run(const std::vector<FragmentOffer>& offers, const HtcOptions& o, double bytes_s) {
  return simulate_samples(offers, o, [&](std::size_t, double) { return bytes_s; }).end_s;
}

TEST(Policies, SurplusIsTheLastResidualAndTheCorrectedBoundHolds) {
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    const std::size_t n = 2 + seed % 60;
    const std::vector<FragmentOffer> offers = some_offers(n, seed);
    const double rate = 1e4, limit = planned(offers) / rate;
    const HtcOptions o = serial(limit, rate * (0.5 + 0.001 * static_cast<double>(seed)),
                                {.order = static_cast<HtcOrder>(seed % 3)});
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

TEST(Policies, EveryFragmentIsDecidedOnceAndTheMeanOneFirst) {
  const std::vector<FragmentOffer> offers = some_offers(50);
  double mean = 0;
  for (const FragmentOffer& f : offers) mean += f.eta / 50;
  for (const HtcOrder order : {HtcOrder::kCredit, HtcOrder::kBeta0, HtcOrder::kFinest}) {
    const HtcOptions o = serial(planned(offers) / 1e4, 1e4, {.order = order});
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

TEST(Policies, CreditsOfOneRunAreThoseWorkedByHand) {
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

TEST(Policies, OrderFollowsTheSignOfTheCredit) {
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

TEST(Policies, MeetsItsLimitOnAnySteadyLink) {
  const std::vector<FragmentOffer> offers = some_offers(200);
  const double limit = planned(offers) / 1e4;
  for (const double rate : {3e3, 6e3, 1e4, 2e4, 4e4}) {
    const double end = constant_run(offers, serial(limit, 1e4), rate);
    EXPECT_NEAR(end, limit, 0.01 * limit) << rate;
  }
}

TEST(Policies, ATenfoldDropIsMetByTheBottomOfTheLadderAndSkips) {
  const std::vector<FragmentOffer> offers = some_offers(256);
  const double limit = planned(offers) / 1e4;
  const BandwidthTrace drop{{0, 0.4 * limit}, {1e4, 1e3}};
  const BandwidthTrace stall{{0, 0.3 * limit, 0.6 * limit}, {1e4, 1, 1e4}};
  for (const LabPolicy policy : {LabPolicy::kHtc, LabPolicy::kGuard}) {
    const HtcOptions o = serial(limit, 1e4, {policy});
    EXPECT_LE(simulate_serial_trace(offers, o, drop).late_s, 0.005 * limit) << static_cast<int>(policy);
    EXPECT_LE(simulate_serial_trace(offers, o, stall).late_s, 0.005 * limit) << static_cast<int>(policy);
  }
  testing::expect_hard_limits_cost(
      offers, serial(limit, 1e4), drop,
      [](const auto& limited, const HtcOptions& hard, const BandwidthTrace& link) {
        return simulate_serial_trace(limited, hard, link);
      });
}

TEST(Policies, RungsThatShowLessThanThePreviewAreNotAskedFor) {
  std::vector<FragmentOffer> offers = some_offers(128);
  for (FragmentOffer& f : offers) f.loss[0] = 0.2;  // rungs 0 and 1 lose 0.5 and 0.25
  const double limit = planned(offers) / 1e4;
  for (const LabPolicy policy : {LabPolicy::kHtc, LabPolicy::kGuard, LabPolicy::kPrice}) {
    const HtcOptions o = serial(limit, 2e3, {policy});
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

TEST(Policies, TheStaticPolicyAdaptsToNothing) {
  const std::vector<FragmentOffer> offers = some_offers(100);
  const HtcOptions o = serial(planned(offers) / 1e4, 1e4, {LabPolicy::kStatic});
  const double end = constant_run(offers, o, 1e4);
  EXPECT_NEAR(constant_run(offers, o, 5e3), 2 * end, 1e-9);
}

TEST(Policies, TheStaticColumnOfTable42IsWhatSuchATransferLeaves) {
  const std::vector<FragmentOffer> offers = table_4_2_offers();
  for (const Table42Row& row : table_4_2(options_of({}), 1)) {
    const HtcOptions o = serial(row.t0_s, row.beta0_kb_s * 1e3, {LabPolicy::kStatic});
    const double end_s = constant_run(offers, o, 41.68e3);
    // Sizes are those of rungs, all together 1 % from the planned ones.
    EXPECT_NEAR(100 * (row.t0_s - end_s) / row.t0_s, row.static_percent, 1.5) << row.beta0_kb_s;
  }
}

/// What a policy loses and how punctual it is, over ten links with bursts.
struct BurstyRuns {
  double loss = 0, latest_s = 0, mean_deviation_percent = 0;
};
BurstyRuns bursty_runs(LabPolicy policy, Estimator estimator, double limit_s) {
  constexpr int kLinks = 10;
  const std::vector<FragmentOffer> offers = some_offers(256);
  BurstyRuns sum;
  for (std::uint64_t seed = 1; seed <= kLinks; ++seed) {
    const HtcOptions o = serial(limit_s, 1e4, {policy, HtcOrder::kCredit, estimator});
    const SimulationResult r =
        simulate_serial_trace(offers, o, random_trace(1e4, 0.9, 0.9, 0.1, 5 * limit_s, seed));
    sum.loss += r.loss;
    sum.latest_s = std::max(sum.latest_s, r.late_s);
    sum.mean_deviation_percent += std::abs(r.deviation_percent) / kLinks;
  }
  return sum;
}

TEST(Policies, PriceAndGuardLoseLessThanTheMethodOnABurstyLinkAndArePunctual) {
  const double limit_s = planned(some_offers(256)) / 1e4;
  const BurstyRuns htc = bursty_runs(LabPolicy::kHtc, Estimator::kLast, limit_s);
  const BurstyRuns guard = bursty_runs(LabPolicy::kGuard, Estimator::kLast, limit_s);
  const BurstyRuns price = bursty_runs(LabPolicy::kPrice, Estimator::kHarmonic, limit_s);
  EXPECT_LT(price.loss, htc.loss);
  EXPECT_LE(price.latest_s, 0.02 * limit_s);
  EXPECT_LT(guard.loss, 0.95 * htc.loss);
  EXPECT_LT(guard.mean_deviation_percent, 0.2);
}

TEST(Policies, LimitsHoldWhileThereIsTimeForThem) {
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

TEST(Policies, AsPrintedAListThatDoesNotMatchLeavesTime) {
  const std::vector<FragmentOffer> offers = some_offers(40);
  const double rate = 2 * planned(offers) / 10;  // the link could carry twice the list
  EXPECT_NEAR(constant_run(offers, serial(10, rate, {LabPolicy::kThesis}), rate), 5, 0.5);
  EXPECT_NEAR(constant_run(offers, serial(10, rate), rate), 10, 0.5);
}

TEST(Policies, EstimatorsWeighSamplesAsTheySay) {
  const auto estimate = [](std::initializer_list<std::pair<double, double>> samples, Estimator estimator) {
    Throughput t(1000);
    EwmaThroughput ewma(1000);
    for (const auto& [bytes, seconds] : samples) t.add(bytes, seconds), ewma.add(bytes, seconds);
    return estimate_bytes_s({.estimator = estimator, .samples = 2}, t, ewma);
  };
  for (const Estimator e : {Estimator::kLast, Estimator::kHarmonic, Estimator::kEwma})
    EXPECT_EQ(estimate({}, e), 1000);
  EXPECT_DOUBLE_EQ(estimate({{500, 1}, {900, 3}}, Estimator::kLast), 300);
  EXPECT_DOUBLE_EQ(estimate({{9, 9}, {500, 1}, {900, 3}}, Estimator::kHarmonic), 350);
  EXPECT_DOUBLE_EQ(estimate({{4000, 8}}, Estimator::kEwma), 900);
  EXPECT_DOUBLE_EQ(estimate({{2000, 4}}, Estimator::kEwma), 950);      // half as large counts half
  EXPECT_TRUE(std::isfinite(estimate({{100, 0}}, Estimator::kEwma)));  // no infinite rate for ever
}

TEST(Table42, IsReproduced) {
  HtcOptions o = options_of({});
  o.hard_limits = true;
  const std::vector<Table42Row> rows = table_4_2(o);
  ASSERT_EQ(rows.size(), 12u);
  const double published[] = {52.0, 44.8, 37.6, 30.4, 23.2, 16.0, 8.8, 1.6, -5.5, -12.0, -19.8, -27.2};
  for (std::size_t i = 0; i < rows.size(); ++i) {
    EXPECT_NEAR(rows[i].static_percent, 100 * (1 - rows[i].beta0_kb_s / 41.68), 1e-9);
    EXPECT_NEAR(rows[i].static_percent, published[i],
                i == 9 ? 0.9 : 0.6);  // the thesis's 47 KB/s is off by 0.8
    // Printed are 0.399 at 20 kB/s, 0.010 at 35 and -0.090 at 53.
    EXPECT_LE(rows[i].deviation_percent, rows[i].beta0_kb_s < 32 ? 0.15 : 0.1) << rows[i].beta0_kb_s;
    EXPECT_LE(rows[i].worst_percent, 1.0) << rows[i].beta0_kb_s;
  }
}

TEST(Table42, ThePublishedOrderMissesTheFirstRows) {
  HtcOptions o = options_of({.order = HtcOrder::kBeta0});
  o.hard_limits = true;
  const std::vector<Table42Row> rows = table_4_2(o);
  // The method page says 10.8, 8.5 and 4.7 % where .40, .35 and .28 are printed.
  const double ours[]{10.8, 8.5, 4.7};
  for (std::size_t i = 0; i < 3; ++i) EXPECT_NEAR(rows[i].deviation_percent, ours[i], 0.1) << i;
  for (std::size_t i = 5; i < rows.size(); ++i) EXPECT_LE(rows[i].deviation_percent, 0.5) << i;
}

}  // namespace texmesh::policies_test
