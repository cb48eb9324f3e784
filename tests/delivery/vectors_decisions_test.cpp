#include "tests/delivery/vectors.h"

#include <cmath>
#include <functional>
#include <tuple>

#include "delivery/cpp/decide/acuity.h"
#include "delivery/cpp/decide/gpu_memory.h"
#include "delivery/cpp/decide/htc_theorem.h"
#include "delivery/cpp/decide/upgrades.h"
#include "delivery/cpp/simulate/network_model.h"
#include "delivery/cpp/simulate/simulation.h"
#include "format/base/portable_math.h"
#include "format/rules/allocation.h"
#include "format/rules/proxy_choice.h"

namespace texmesh {
namespace {

/// Rungs of 200, 330, 545 .. bytes times a size of their own, losses that halve.
std::vector<FragmentOffer> some_offers(std::size_t n, std::size_t rungs, std::uint64_t seed) {
  TraceRandom random(seed);
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

Json step_json(const HtcStep& s) {
  return {{"position", s.position},
          {"offer", s.offer},
          {"rung", s.rung},
          {"bytes", s.bytes},
          {"credit_s", s.credit_s},
          {"theta_s", s.theta_s},
          {"target_bytes", s.target_bytes},
          {"throughput_bytes_s", s.throughput_bytes_s}};
}

/// Plays the plan over a network; with `fail_each` > 0 every so-manieth transfer is given up.
Json play(const std::string& name, const std::vector<FragmentOffer>& offers, const HtcOptions& options,
          const NetworkOptions& network, std::size_t fail_each = 0) {
  HarmonicTimePlan plan(offers, options);
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
              {"unspent_s", plan.unspent_s()},
              {"too_short_for_rtt", plan.too_short_for_rtt()}};
  if (options.window == 1 && !fail_each) {
    const HtcTheorem t = theorem_of(plan);
    result["theorem"] = {{"surplus_s", t.surplus_s},
                         {"last_residual_s", t.last_residual_s},
                         {"corrected_bound_s", t.corrected_bound_s},
                         {"published_bound_s", t.published_bound_s}};
  }
  return {{"name", name},
          {"offers", offers_json(offers)},
          {"options", options_json(options)},
          {"calls", calls},
          {"result", result}};
}

HtcOptions limit(const std::vector<FragmentOffer>& offers, double bytes_s, Policy policy, int window) {
  HtcOptions o;
  o.policy = policy;
  o.window = window;
  o.time_limit_s = 0;
  for (const FragmentOffer& f : offers) o.time_limit_s += f.planned_bytes / bytes_s;
  o.throughput.initial_bytes_s = bytes_s;
  return o;
}

Json harmonic_time() {
  Json cases = Json::array();
  const auto link = [](const BandwidthTrace& trace, double rtt_s) {
    NetworkOptions n;
    n.link = trace;
    n.rtt_s = rtt_s;
    return n;
  };
  const BandwidthTrace bursty = random_trace(2e4, 0.5, 0.9, 0.05, 10, 7);
  std::uint64_t seed = 1;
  for (const auto& [policy, name] : kPolicies)
    for (const int window : {1, 0}) {
      const auto offers = some_offers(24, 6, seed++);
      HtcOptions o = limit(offers, 2e4, policy, window);
      const double rtt_s = window ? 0 : 0.04;
      o.rtt_s = rtt_s;
      cases.push_back(play(std::string(name) + (window ? ", one at a time" : ", window by round trips"),
                           offers, o, link(bursty, rtt_s)));
    }
  for (const auto& [order, name] : kOrders) {
    const auto offers = some_offers(20, 5, seed++);
    HtcOptions o = limit(offers, 2.4e4, Policy::kHtc, 1);
    o.order = order;
    cases.push_back(play(std::string("order ") + name, offers, o, link(bursty, 0)));
  }
  for (const auto& [estimator, name] : kEstimators) {
    const auto offers = some_offers(20, 5, seed++);
    HtcOptions o = limit(offers, 1.5e4, Policy::kGuard, 4);
    o.throughput.estimator = estimator;
    o.throughput.samples = 4;
    o.rtt_s = 0.05;
    cases.push_back(play(std::string("estimator ") + name, offers, o, link(bursty, 0.05)));
  }
  const BandwidthTrace drop{{0, 0.3}, {2e4, 2e3}};
  for (const bool hard : {false, true}) {
    const auto offers = some_offers(30, 6, 40);
    HtcOptions o = limit(offers, 2e4, Policy::kHtc, 1);
    o.hard_limits = hard;
    cases.push_back(play(hard ? "tenfold drop, limits of quality are kept" : "tenfold drop, skips", offers, o,
                         link(drop, 0)));
  }
  const auto offers = some_offers(18, 6, 41);
  cases.push_back(play("every fifth transfer is given up", offers, limit(offers, 2e4, Policy::kGuard, 3),
                       link(bursty, 0.02), 5));
  for (const Policy policy : {Policy::kHtc, Policy::kGuard, Policy::kPrice}) {
    auto worse = some_offers(24, 6, 43);
    for (std::size_t i = 0; i < worse.size(); ++i) worse[i].loss[0] = 0.9 * worse[i].loss[1 + i % 4];
    cases.push_back(play(std::string("the lowest rungs show less than the preview, ") + kPolicies.at(policy),
                         worse, limit(worse, 1.2e4, policy, 0), link(bursty, 0.02)));
  }
  const auto one = some_offers(1, 3, 42);
  cases.push_back(play("one fragment", one, limit(one, 2e4, Policy::kHtc, 0), link(bursty, 0.02)));
  return cases;
}

Json throughput() {
  Json cases = Json::array();
  for (const auto& [estimator, name] : kEstimators)
    for (const int samples : {1, 5, 64}) {
      ThroughputOptions o;
      o.estimator = estimator;
      o.samples = samples;
      Throughput t(o);
      TraceRandom random(static_cast<std::uint64_t>(samples));
      Json calls = Json::array();
      for (int i = 0; i < 80; ++i) {
        const double bytes = std::floor(20000 * random.uniform()),
                     seconds = i % 9 ? 0.2 * random.uniform() : 0;
        t.add(bytes, seconds);
        calls.push_back({bytes, seconds, t.bytes_s(), t.recent_bytes_s(3)});
      }
      cases.push_back({{"name", std::string(name) + " " + std::to_string(samples)},
                       {"options", options_json(o)},
                       {"add_bytes_seconds_then_bytes_s_and_recent_3", calls}});
    }
  return cases;
}

Json upgrades() {
  Json cases = Json::array();
  for (const bool incremental : {false, true}) {
    const auto offers = some_offers(16, 5, 60);
    std::vector<std::int32_t> rungs;
    for (std::size_t i = 0; i < offers.size(); ++i) rungs.push_back(static_cast<std::int32_t>(i % 6) - 1);
    Json order = Json::array();
    for (const Upgrade& u : upgrades_in_order(offers, rungs, incremental))
      order.push_back({u.offer, u.rung, u.bytes, u.gain_per_byte});
    cases.push_back({{"name", incremental ? "incremental rungs" : "independent rungs"},
                     {"incremental", incremental},
                     {"offers", offers_json(offers)},
                     {"rungs", rungs},
                     {"offer_rung_bytes_gain", order}});
  }
  return cases;
}

Json portable_math() {
  Json cases = Json::array();
  const auto add = [&](const char* name, const std::function<double(double)>& f, double low, double high) {
    Json pairs = Json::array();
    TraceRandom random(99);
    for (int i = 0; i < 40; ++i) {
      const double x = i == 0 ? low : i == 1 ? high : low + (high - low) * random.uniform();
      pairs.push_back({x, f(x)});
    }
    cases.push_back({{"name", name}, {"x_y", pairs}});
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
  add("acuity", acuity_at, 0, 30);
  add("gaze_weight", gaze_weight, 0, 30);
  return cases;
}

Json proxies() {
  Json cases = Json::array();
  const auto add = [&](const char* name, const std::vector<double>& sizes,
                       std::vector<ManifestProxy> proxies) {
    Manifest m;
    m.proxy_sizes_px = sizes;
    m.proxies = std::move(proxies);
    Json listed = Json::array(), answers = Json::array();
    for (std::size_t k = 0; k < m.proxies.size(); ++k) {
      const ManifestProxy& p = m.proxies[k];
      listed.push_back({{"offset", p.glb.offset},
                        {"bytes", p.glb.bytes},
                        {"flip", p.flip},
                        {"flip_p95", p.flip_p95},
                        {"bytes_beyond_start", proxy_bytes_beyond_start(m, k)}});
    }
    for (const double px : {0.0, 1.0, 60.0, 128.0, 200.0, 256.0, 300.5, 511.0, 512.0, 700.0, 1e4, 1e9}) {
      Json losses = Json::array();
      for (std::size_t k = 0; k < m.proxies.size(); ++k) {
        const ProxyLoss loss = proxy_loss(m, k, px);
        losses.push_back({loss.flip, loss.flip_p95});
      }
      const auto serving = serving_proxy(m, px);
      answers.push_back({px, losses, serving ? Json(*serving) : Json(-1)});
    }
    cases.push_back(
        {{"name", name}, {"sizes_px", sizes}, {"proxies", listed}, {"px_losses_serving", answers}});
  };
  const auto proxy = [](std::uint64_t offset, std::uint64_t bytes, std::vector<double> flip,
                        std::vector<double> p95) {
    return ManifestProxy{{"", offset, bytes, {}}, 1, 1, 0, std::move(flip), std::move(p95)};
  };
  add("three sizes", {128, 256, 512},
      {proxy(8192, 20000, {0.06, 0.09, 0.17}, {0.2, 0.3, 0.45}),
       proxy(40000, 50000, {0.03, 0.05, 0.11}, {0.1, 0.16, 0.3}),
       proxy(200000, 150000, {0.02, 0.03, 0.048}, {0.07, 0.1, 0.15})});
  add("one size", {300}, {proxy(8192, 60000, {0.05}, {0.15})});
  add("none", {}, {});
  return cases;
}

/// Three proxies before a package of some 5 MB with two scales besides the coarsest.
Manifest stepped_manifest() {
  Manifest m;
  m.proxy_sizes_px = {128, 512};
  m.proxies = {{{"", 4096, 20000, {}}, 800, 900, 192, {0.25, 0.34}, {0.5, 0.7}},
               {{"", 260000, 50000, {}}, 2000, 2100, 224, {0.16, 0.24}, {0.3, 0.5}},
               {{"", 310000, 150000, {}}, 8000, 7000, 416, {0.09, 0.13}, {0.2, 0.3}}};
  m.index = {{"", 26000, 4000, {}}, 700, {}};
  m.tables = {{"", 52000, 27000, {}}, 600, {}};
  m.provenance = {"", 5'000'000, 2800, {}};
  for (const auto& [scale, bytes, offset] :
       {std::tuple{0, 300000, 600000}, {5, 160000, 900000}, {16, 90000, 170000}}) {
    ManifestScale s;
    s.scale = scale;
    s.glb = {"", static_cast<std::uint64_t>(offset), static_cast<std::uint64_t>(bytes), {}};
    m.scales.push_back(s);
  }
  return m;
}

Json proxy_steps() {
  const Manifest m = stepped_manifest();
  Json entry{{"name", "on the way to a scale"},
             {"sizes_px", m.proxy_sizes_px},
             {"document_bytes", document_bytes(m)}};
  const auto range = [](const EntryRef& e) { return Json{{"offset", e.offset}, {"bytes", e.bytes}}; };
  for (const ManifestProxy& p : m.proxies) {
    entry["proxies"].push_back(range(p.glb));
    entry["proxies"].back().update({{"flip", p.flip}, {"flip_p95", p.flip_p95}});
  }
  for (const ManifestScale& s : m.scales) {
    entry["scales"].push_back(range(s.glb));
    entry["scales"].back()["scale"] = s.scale;
  }
  entry["index"] = range(m.index), entry["tables"] = range(m.tables),
  entry["provenance"] = range(m.provenance);
  for (const int wanted : {0, 5, 16})
    for (const double px : {100.0, 600.0})
      for (const double bytes_s : {1e4, 3e4, 1e5, 2.5e5, 1e6, 2e7})
        for (const double left_s : {0.0, 0.7, 4.5}) {
          const auto step = proxy_step(m, wanted, px, {bytes_s, 0.04, left_s});
          entry["wanted_px_bytes_s_left_s_step"].push_back(
              {wanted, px, bytes_s, left_s, step ? Json(*step) : Json(-1)});
        }
  return entry;
}

/// [width, height, RGBA, blocks of 8 bytes, of 16] and [vertices, triangles, bytes].
Json gpu_sizes() {
  Json textures = Json::array(), meshes = Json::array();
  for (const auto& [w, h] :
       {std::pair{0u, 0u}, {1u, 1u}, {5u, 3u}, {256u, 256u}, {1000u, 3u}, {4096u, 2048u}})
    textures.push_back({w, h, gpu_texture_bytes(w, h), gpu_texture_bytes(w, h, GpuTexels::kBlock8),
                        gpu_texture_bytes(w, h, GpuTexels::kBlock16)});
  for (const auto& [v, t] : {std::pair{0u, 0u}, {3u, 1u}, {71831u, 98516u}})
    meshes.push_back({v, t, gpu_mesh_bytes(v, t)});
  return {{"name", "bytes on the GPU"}, {"textures", textures}, {"meshes", meshes}};
}

TEST(Vectors, Proxies) {
  Json cases = proxies();
  cases.push_back(proxy_steps());
  cases.push_back(gpu_sizes());
  expect_file("proxies.json",
              "FLIP of proxies by displayed height, the smallest one that is enough, the larger one on the "
              "way to a scale; bytes on the GPU",
              cases);
}
TEST(Vectors, StepsAreTakenOnSlowLinksAlone) {
  const Manifest m = stepped_manifest();
  EXPECT_TRUE(proxy_step(m, 0, 600, {2.5e5, 0.04, 4.5}));  // 2 Mbit/s
  EXPECT_FALSE(proxy_step(m, 0, 600, {2e7, 0.04, 4.5}));   // scales are there as soon
  EXPECT_FALSE(proxy_step(m, 0, 600, {1e4, 0.04, 0.7}));   // no proxy comes in the time
  EXPECT_FALSE(proxy_step(m, 0, 600, {2.5e5, 0.04, 0}));
  Manifest same = m;
  for (ManifestProxy& p : same.proxies) p.flip = {0.2, 0.2};
  EXPECT_FALSE(proxy_step(same, 0, 600, {2.5e5, 0.04, 4.5}));  // none looks better
}
TEST(Vectors, HarmonicTime) {
  expect_file("harmonic-time.json", "calls of a HarmonicTimePlan in order, and what it answers",
              harmonic_time());
}
TEST(Vectors, Throughput) {
  expect_file("throughput.json", "samples added to a Throughput, and its estimates after each", throughput());
}
TEST(Vectors, Upgrades) {
  expect_file("upgrades.json", "upgrades_in_order: offer, rung, bytes, gain per byte", upgrades());
}
TEST(Vectors, PortableMath) {
  expect_file("portable-math.json", "functions whose bits decide", portable_math());
}

}  // namespace
}  // namespace texmesh
