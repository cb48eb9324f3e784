#pragma once
// The cases of harmonic-time.json, throughput.json and portable-math.json, for the policies and estimators
// that are known.
#include <cmath>

#include "delivery/cpp/simulate/simulation.h"
#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "tests/delivery/made_links.h"
#include "tests/delivery/vectors.h"

namespace texmesh {

/// Rungs of 200, 330, 545 .. bytes times a size of their own, losses that halve.
inline std::vector<FragmentOffer> vector_offers(std::size_t n, std::size_t rungs, std::uint64_t seed) {
  testing::MadeNumbers random(seed);
  std::vector<FragmentOffer> offers(n);
  for (FragmentOffer& f : offers) {
    const double size = 0.5 + random.uniform();
    f.eta = std::floor(64 * random.uniform()) / 64;  // ties happen
    double bytes = 200 * size, loss = 0.3 * random.uniform();
    f.loss.push_back(4 * loss);
    for (std::size_t r = 0; r < rungs; ++r, bytes *= 1.65, loss *= 0.5) {
      f.bytes.push_back(static_cast<std::uint32_t>(bytes));
      f.loss.push_back(loss);
    }
    f.planned_bytes = 200 * size * (1 + 6 * random.uniform());
    f.low_rung = 1;
    f.high_rung = static_cast<std::uint16_t>(rungs - 1 - (seed % 2));
  }
  return offers;
}

// ---- harmonic-time.json: every call of a plan, and what it answered

inline Json step_json(const HtcStep& s) {
  return {{"position", s.position},
          {"offer", s.offer},
          {"rung", s.rung},
          {"bytes", s.bytes},
          {"credit_s", s.credit_s},
          {"theta_s", s.theta_s},
          {"target_bytes", s.target_bytes},
          {"throughput_bytes_s", s.throughput_bytes_s}};
}

/// More of a plan that has ended.
using PlanFigures = std::function<Json(const HarmonicTimePlan& plan)>;

/// Plays the plan over a network; with `fail_each` > 0 every so-manieth transfer is given up.
inline Json play(const std::string& name, const std::vector<FragmentOffer>& offers,
                 const VectorOptions& options, const NetworkOptions& network, const PlanFigures& theorem,
                 std::size_t fail_each) {
  HarmonicTimePlan plan(offers, options.htc);
  NetworkModel model(network);
  Json calls = Json::array();
  std::size_t ended = 0;
  while (!plan.finished()) {
    for (;;) {
      const double now_s = model.now_s();
      const HtcStep* step = plan.next(now_s);
      calls.push_back({"next", now_s, step ? step_json(*step) : Json(nullptr)});
      if (!step) break;
      model.request(step->offer, 0, step->bytes);
    }
    if (plan.finished()) break;
    const auto arrival = model.advance(1e9);
    if (!arrival) break;
    const bool fails = fail_each && ++ended % fail_each == 0;
    fails ? plan.failed(arrival->request, arrival->time_s)
          : plan.completed(arrival->request, arrival->time_s);
    calls.push_back({fails ? "failed" : "completed", arrival->request, arrival->time_s});
  }
  EXPECT_TRUE(plan.finished()) << name;
  Json steps = Json::array();
  for (const HtcStep& s : plan.steps())
    steps.push_back({s.offer, s.rung, s.bytes, s.done_s, s.spacing_s, s.residual_s});
  Json result{{"steps", steps},
              {"rungs", plan.rungs()},
              {"throughput_bytes_s", plan.throughput_bytes_s()},
              {"surplus_s", plan.surplus_s()},
              {"unspent_s", plan.unspent_s()}};
  if (theorem && options.htc.window == 1 && !fail_each) result["theorem"] = theorem(plan);
  return {{"name", name},
          {"offers", offers_json(offers)},
          {"options", options_json(options)},
          {"calls", calls},
          {"result", result}};
}

inline VectorOptions limit(const std::vector<FragmentOffer>& offers, double bytes_s,
                           const std::string& policy, int window) {
  VectorOptions o{policy};
  o.htc.window = window;
  o.htc.time_limit_s = 0;
  for (const FragmentOffer& f : offers) o.htc.time_limit_s += f.planned_bytes / bytes_s;
  o.htc.initial_bytes_s = bytes_s;
  return o;
}

/// The cases whose policy is known.
inline Json harmonic_time(const KnowsPolicy& knows, const PlanFigures& theorem = {}) {
  Json cases = Json::array();
  const auto link = [](const BandwidthTrace& trace, double rtt_s) {
    NetworkOptions n;
    n.link = trace;
    n.rtt_s = rtt_s;
    return n;
  };
  const auto add = [&](const std::string& name, const std::vector<FragmentOffer>& offers, VectorOptions o,
                       const NetworkOptions& network, std::size_t fail_each = 0) {
    if (knows(o)) cases.push_back(play(name, offers, o, network, theorem, fail_each));
  };
  const BandwidthTrace bursty = testing::made_link(2e4, 0.5, 0.9, 0.05, 10, 7);
  std::uint64_t seed = 1;
  for (const std::string& policy : kPolicies)
    for (const int window : {1, 0}) {
      const auto offers = vector_offers(24, 6, seed++);
      VectorOptions o = limit(offers, 2e4, policy, window);
      o.htc.rtt_s = window ? 0 : 0.04;
      add(policy + (window ? ", one at a time" : ", window by round trips"), offers, o,
          link(bursty, o.htc.rtt_s));
    }
  for (const char* order : {"credit", "beta0", "finest"}) {
    const auto offers = vector_offers(20, 5, seed++);
    VectorOptions o = limit(offers, 2.4e4, "htc", 1);
    o.order = order;
    add(std::string("order ") + order, offers, o, link(bursty, 0));
  }
  for (const char* estimator : {"last", "harmonic", "ewma"}) {
    const auto offers = vector_offers(20, 5, seed++);
    VectorOptions o = limit(offers, 1.5e4, "guard", 4);
    o.estimator = estimator;
    o.samples = 4;
    o.htc.rtt_s = 0.05;
    add(std::string("estimator ") + estimator, offers, o, link(bursty, 0.05));
  }
  const BandwidthTrace drop{{0, 0.3}, {2e4, 2e3}};
  for (const bool hard : {false, true}) {
    const auto offers = vector_offers(30, 6, 40);
    VectorOptions o = limit(offers, 2e4, "htc", 1);
    o.htc.hard_limits = hard;
    add(hard ? "tenfold drop, limits of quality are kept" : "tenfold drop, skips", offers, o, link(drop, 0));
  }
  const auto offers = vector_offers(18, 6, 41);
  add("every fifth transfer is given up", offers, limit(offers, 2e4, "guard", 3), link(bursty, 0.02), 5);
  for (const char* policy : {"htc", "guard", "price"}) {
    auto worse = vector_offers(24, 6, 43);
    for (std::size_t i = 0; i < worse.size(); ++i) worse[i].loss[0] = 0.9 * worse[i].loss[1 + i % 4];
    add(std::string("the lowest rungs show less than the preview, ") + policy, worse,
        limit(worse, 1.2e4, policy, 0), link(bursty, 0.02));
  }
  const auto one = vector_offers(1, 3, 42);
  add("one fragment", one, limit(one, 2e4, "htc", 0), link(bursty, 0.02));
  return cases;
}

/// `estimate`: adds a transfer and gives the estimate.
using Estimate = std::function<double(double bytes, double seconds, Throughput& all)>;
using MakesEstimate = std::function<Estimate(const std::string& estimator, int samples)>;
/// The cases whose estimator is known.
inline Json throughput(const MakesEstimate& make) {
  Json cases = Json::array();
  for (const char* estimator : {"last", "harmonic", "ewma"})
    for (const int samples : {1, 5, 64}) {
      const Estimate estimate = make(estimator, samples);
      if (!estimate) continue;
      Throughput t(1e5);
      testing::MadeNumbers random(static_cast<std::uint64_t>(samples));
      Json calls = Json::array();
      for (int i = 0; i < 80; ++i) {
        const double bytes = std::floor(20000 * random.uniform()),
                     seconds = i % 9 ? 0.2 * random.uniform() : 0;
        const double bytes_s = estimate(bytes, seconds, t);
        calls.push_back({bytes, seconds, bytes_s, t.recent_bytes_s(3)});
      }
      cases.push_back({{"name", std::string(estimator) + " " + std::to_string(samples)},
                       {"options", throughput_json(estimator, samples, 1e5)},
                       {"add_bytes_seconds_then_bytes_s_and_recent_3", calls}});
    }
  return cases;
}

/// Adds pairs of x from `low` to `high` and f(x).
inline void add_function(const char* name, const std::function<double(double)>& f, double low, double high,
                         Json& cases) {
  Json pairs = Json::array();
  testing::MadeNumbers random(99);
  for (int i = 0; i < 40; ++i) {
    const double x = i == 0 ? low : i == 1 ? high : low + (high - low) * random.uniform();
    pairs.push_back({x, f(x)});
  }
  cases.push_back({{"name", name}, {"x_y", pairs}});
}

inline Json portable_math() {
  Json cases = Json::array();
  const auto add = [&](const char* name, const std::function<double(double)>& f, double low, double high) {
    add_function(name, f, low, high, cases);
  };
  add("exp", portable::exp, -60, 60);
  add("exp", portable::exp, -1, 1);
  add("log", portable::log, 1e-12, 10);
  add("log", portable::log, 0.5, 1e9);
  add("sin", portable::sin, -10, 10);
  add("cos", portable::cos, -10, 10);
  add(
      "pow of 0.37", [](double x) { return portable::pow(0.37, x); }, -3, 3);
  add("log_quantiser", log_quantiser, 1, 100);
  return cases;
}

}  // namespace texmesh
