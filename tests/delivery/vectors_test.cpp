// The test vectors in delivery/vectors say what every client decides (delivery/vectors/README.md). They are
// written by this program and compared with what it would write today; the TypeScript client runs the same
// files.
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "delivery/cpp/client/delivery_plan.h"
#include "delivery/cpp/decide/htc_theorem.h"
#include "delivery/cpp/decide/upgrades.h"
#include "format/base/portable_math.h"
#include "format/container/layout.h"
#include "format/documents/allocation.h"
#include "format/documents/rate_distortion.h"
#include "format/documents/size_curve.h"
#include "format/split/split_reader.h"
#include "format/split/split_stream.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
const std::string kRoot = TEXMESH_SOURCE_DIR;

// ---- names of options, as in the files

const std::map<Policy, const char*> kPolicies{{Policy::kHtc, "htc"},
                                              {Policy::kGuard, "guard"},
                                              {Policy::kPrice, "price"},
                                              {Policy::kProportional, "proportional"},
                                              {Policy::kStatic, "static"}};
const std::map<HtcOrder, const char*> kOrders{
    {HtcOrder::kCredit, "credit"}, {HtcOrder::kBeta0, "beta0"}, {HtcOrder::kFinest, "finest"}};
const std::map<Estimator, const char*> kEstimators{
    {Estimator::kLast, "last"}, {Estimator::kHarmonic, "harmonic"}, {Estimator::kEwma, "ewma"}};
const std::map<StepRule, const char*> kRules{{StepRule::kDefault, "default"},
                                             {StepRule::kJnd, "jnd"},
                                             {StepRule::kError, "error"},
                                             {StepRule::kEdge, "edge"}};

Json options_json(const ThroughputOptions& o) {
  return {{"estimator", kEstimators.at(o.estimator)},
          {"samples", o.samples},
          {"ewma", o.ewma},
          {"small_bytes", o.small_bytes},
          {"initial_bytes_s", o.initial_bytes_s}};
}
Json options_json(const HtcOptions& o) {
  return {{"policy", kPolicies.at(o.policy)},
          {"order", kOrders.at(o.order)},
          {"time_limit_s", o.time_limit_s},
          {"throughput", options_json(o.throughput)},
          {"rtt_s", o.rtt_s},
          {"window", o.window},
          {"max_in_flight", o.max_in_flight},
          {"hard_limits", o.hard_limits},
          {"guard", o.guard},
          {"price_kappa", o.price_kappa}};
}
Json offer_json(const FragmentOffer& f) {
  return {{"bytes", f.bytes},       {"loss", f.loss},
          {"eta", f.eta},           {"planned_bytes", f.planned_bytes},
          {"low_rung", f.low_rung}, {"high_rung", f.high_rung}};
}
Json offers_json(const std::vector<FragmentOffer>& offers) {
  Json out = Json::array();
  for (const FragmentOffer& f : offers) out.push_back(offer_json(f));
  return out;
}

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
  return cases;
}

// ---- packages: what a client reads in the golden ones

std::string hex(const Sha256& digest) {
  static constexpr char kDigits[] = "0123456789abcdef";
  std::string out;
  for (const std::uint8_t b : digest) out += {kDigits[b >> 4], kDigits[b & 15]};
  return out;
}
template <class T>
std::string digest_of(const std::vector<T>& values) {
  const auto* bytes = reinterpret_cast<const std::uint8_t*>(values.data());
  return hex(sha256({bytes, values.size() * sizeof(T)}));
}

Json viewing(PackageReader& package) {
  const Manifest& m = package.manifest();
  Json rules = Json::object();
  const std::vector<double> sizes{1, 20, 64, 100, 150, 300, 500, 800, 1200, 2000, 4000, 1e5};
  for (const auto& [rule, name] : kRules) {
    const auto steps = step_function(m.scales, rule);
    Json shown = Json::array(), at = Json::array();
    for (const ManifestStep& s : steps) shown.push_back({s.up_to_px, s.scale});
    for (const double px : sizes) at.push_back({px, scale_at(steps, px)});
    rules[name] = {{"steps", shown}, {"displayed_px_scale", at}};
  }
  Json parts = Json::array();
  const ScreenRect object{100, 50, 900, 1250};
  for (const ScreenRect& view : {ScreenRect{0, 0, 1000, 1400}, ScreenRect{300, 200, 500, 900},
                                 ScreenRect{850, 0, 1500, 300}, ScreenRect{-50, -50, 10, 10}}) {
    const VisiblePart part = clip_to(object, view);
    Json scales = Json::object();
    for (const auto& [rule, name] : kRules) scales[name] = select_scale(m, 1200, part, rule);
    parts.push_back({{"view", {view.x0, view.y0, view.x1, view.y1}},
                     {"part", {part.width_px, part.height_px, part.clipped}},
                     {"scale_of_1200_px", scales}});
  }
  const VisiblePart seen = clip_to(object, ScreenCircle{400, 400, fovea_radius_px(1500)});
  const Camera camera;
  Json errors = Json::array();
  for (const ManifestScale& s : m.scales) {
    const PixelError e = pixel_error(m, s, 700);
    errors.push_back({s.scale, e.p95, e.rms, e.max});
  }
  return {{"rules", rules},
          {"object", {object.x0, object.y0, object.x1, object.y1}},
          {"clips", parts},
          {"fovea",
           {{"centre_px", {400, 400}},
            {"eye_px", 1500},
            {"radius_px", fovea_radius_px(1500)},
            {"part", {seen.width_px, seen.height_px, seen.clipped}}}},
          {"displayed_px_at_distance_3_heights",
           displayed_height_px(m.object_height, 3 * m.object_height, camera)},
          {"distance_at_300_px", viewing_distance(m.object_height, 300, camera)},
          {"scale_error_p95_rms_max_at_700_px", errors}};
}

/// Sizes along knots between every two rungs, which the golden packages do not have.
Json sizes_along_knots(PlaneTables t) {
  for (std::size_t r = 0; r + 1 < t.rung_count(); ++r)
    for (const int k : {1, 2})
      if (t.rung_quality[r] + k < t.rung_quality[r + 1]) {
        t.knot_quality.push_back(static_cast<std::uint8_t>(t.rung_quality[r] + k));
        t.knot_position.push_back(0.375f * static_cast<float>(k));
      }
  Json sizes = Json::array();
  for (const std::uint16_t f : t.order)
    for (const double quality : {3.0, 12.0, 33.0, 54.0, 77.5, 99.0})
      sizes.push_back({f, quality, interpolated_bytes(t, f, quality)});
  return {{"quality", t.knot_quality}, {"position", t.knot_position}, {"fragment_quality_bytes", sizes}};
}

Json plane_tables(const PlaneTables& t, std::uint32_t plane) {
  Json scales = Json::array();
  for (const std::uint32_t scale : {0u, t.scales / 2, t.scales}) {
    Json gammas = Json::array();
    for (const double gamma : {0.0, mean_eta(t, scale), 0.8}) {
      const auto rungs = rungs_of(t, scale, gamma);
      gammas.push_back({{"gamma", gamma},
                        {"quality", quality_of(t, scale, gamma)},
                        {"rungs", rungs},
                        {"bytes", sum_of(bytes_of(t, rungs))},
                        {"surface_dssim", surface_dssim(t, rungs)}});
    }
    scales.push_back({{"scale", scale}, {"eta", eta_of(t, scale)}, {"gammas", gammas}});
  }
  Json sizes = Json::array();
  for (const std::uint16_t f : t.order)
    for (const double quality : {3.0, 33.0, 77.5, 99.0})
      sizes.push_back({f, quality, interpolated_bytes(t, f, quality)});
  Json rd = Json::array();
  for (const std::uint64_t budget : {500ull, 3000ull, 12000ull})
    rd.push_back({budget, allocate_rd(t, budget)});
  return {{"plane", plane},
          {"surface_weights", surface_weights(t)},
          {"scales", scales},
          {"fragment_quality_bytes", sizes},
          {"knots", sizes_along_knots(t)},
          {"budget_rungs", rd}};
}

Json budgets(PackageReader& package, double displayed_px, const ListOptions& options) {
  Json out = Json::array();
  for (const std::uint64_t bytes : {0ull, 1500ull, 6000ull, 20000ull, 1000000ull}) {
    const TextureBudget b = texture_for_budget(package, displayed_px, options, bytes);
    Json shown = Json::array();
    for (const PlaneChoice& p : b.planes) shown.push_back({p.base, p.plane});
    out.push_back({{"budget_bytes", bytes},
                   {"planes", shown},
                   {"mip_loss", mip_loss(package, b.planes, displayed_px)},
                   {"rungs", b.rungs},
                   {"bytes", b.bytes},
                   {"dssim", b.dssim}});
  }
  return out;
}

Json lists(PackageReader& package) {
  Json out = Json::array();
  for (const double px : {40.0, 200.0, 1000.0}) {
    const auto planes = planes_for_display(package, px);
    Json shown = Json::array();
    for (const PlaneChoice& p : planes) shown.push_back({p.base, p.plane});
    ListOptions o;
    o.scale = select_scale(package.manifest(), px);
    const FragmentList list = fragment_list(package, planes, o);
    Json fragments = Json::array(), qualities = Json::array();
    for (const ListedFragment& f : list.fragments) fragments.push_back({f.plane, f.fragment});
    for (const double dssim : {0.0, 0.003, 0.02, 0.2}) {
      const double quality = equivalent_quality(package, planes, dssim);
      qualities.push_back({dssim, quality, predicted_ssim(package.quality(), o.scale, quality)});
    }
    out.push_back({{"displayed_px", px},
                   {"scale", o.scale},
                   {"finer_where_seen", finer_where_seen(package.quality(), o.scale, px)},
                   {"planes", shown},
                   {"fragments", fragments},
                   {"offers", offers_json(list.offers)},
                   {"total_weight", list.total_weight},
                   {"preview_loss", list.preview_loss},
                   {"dssim_quality_ssim", qualities},
                   {"budgets", budgets(package, px, o)}});
  }
  return out;
}

/// What is chosen over links that are fast, slow and too slow.
Json plans(PackageReader& package) {
  Json out = Json::array();
  for (const auto& [policy, name] : kPolicies)
    for (const double px : {60.0, 400.0, 1500.0})
      for (const double bytes_s : {4e3, 2e4, 3e5})
        for (const double limit_s : {1.0, 4.0}) {
          DeliveryRequest r;
          r.displayed_px = px;
          r.time_limit_s = limit_s;
          r.htc.policy = policy;
          r.network.link = BandwidthTrace::constant(bytes_s);
          r.network.rtt_s = bytes_s > 1e5 ? 0.01 : 0.05;
          const DeliveryPlan p = plan_delivery(package, r);
          Json shown = Json::array();
          for (const PlaneChoice& c : p.planes) shown.push_back({c.base, c.plane});
          out.push_back({{"policy", name},
                         {"displayed_px", px},
                         {"bytes_s", bytes_s},
                         {"rtt_s", r.network.rtt_s},
                         {"time_limit_s", limit_s},
                         {"wanted_scale", wanted_scale(package, r)},
                         {"scale", p.scale},
                         {"planes", shown},
                         {"rungs", p.textures.rungs},
                         {"times_s", {p.first_picture_s, p.mesh_s, p.complete_s}},
                         {"bytes", p.bytes()},
                         {"texture_dssim", p.texture_dssim},
                         {"ssim", p.ssim}});
        }
  return out;
}

Json fragments(PackageReader& package) {
  Json out = Json::array();
  for (std::uint32_t plane = 0; plane < package.textures().size(); ++plane) {
    const TextureInfo& texture = package.textures()[plane];
    for (std::uint32_t rung = 0; rung < texture.rungs.size(); rung += 3)
      for (const std::uint16_t f : package.tables().planes[plane].order) {
        const ByteRange r = package.fragment_range(plane, rung, f);
        out.push_back({plane, rung, f, texture.rungs[rung].path, texture.rungs[rung].offset + r.offset,
                       r.bytes, hex(sha256(package.complete_fragment(plane, rung, f)))});
      }
  }
  return out;
}

Json split_stream(PackageReader& package) {
  SplitStreamReader reader(package.split_stream_head());
  const auto stream = package.entry(kSplitStreamPath);
  Json out = Json::array();
  for (std::size_t i = 0; i < reader.head().scales.size(); ++i) {
    reader.read_to_scale(i, stream);
    const SplitMesh& mesh = reader.mesh();
    Json attributes = Json::array();
    for (std::size_t k = 0; k < mesh.attributes(); ++k) attributes.push_back(digest_of(mesh.values(k)));
    out.push_back({{"scale", reader.head().scales[i].scale},
                   {"points", mesh.points().size()},
                   {"wedges", mesh.wedge_point().size()},
                   {"faces", mesh.faces().size()},
                   {"visible_faces", mesh.visible_faces().size()},
                   {"points_sha256", digest_of(mesh.points())},
                   {"wedge_points_sha256", digest_of(mesh.wedge_point())},
                   {"faces_sha256", digest_of(mesh.faces())},
                   {"groups_sha256", digest_of(mesh.face_group())},
                   {"values_sha256", attributes}});
  }
  return out;
}

Json packages() {
  Json cases = Json::array();
  for (const char* name : {"v1.0-scan", "v1.1-scan"}) {
    const std::string path = std::string("tests/golden/") + name + ".texmesh";
    PackageReader package(open_store(kRoot + "/" + path));
    Json planes = Json::array();
    for (std::uint32_t p = 0; p < package.tables().planes.size(); ++p)
      planes.push_back(plane_tables(package.tables().planes[p], p));
    Json entries = Json::array();
    for (const EntryRef& e : package.index()) entries.push_back({e.path, e.offset, e.bytes, hex(e.digest)});
    cases.push_back({{"name", name},
                     {"file", path},
                     {"id", hex(package.id())},
                     {"entry_path_offset_bytes_sha256", entries},
                     {"viewing", viewing(package)},
                     {"tables", planes},
                     {"lists", lists(package)},
                     {"plans", plans(package)},
                     {"fragment_plane_rung_index_path_offset_bytes_sha256", fragments(package)}});
    if (package.manifest().stream) cases.back()["split_stream"] = split_stream(package);
  }
  return cases;
}

// ---- the files

/// One case a line: a change of a decision shows as a change of its line.
std::string text_of(const char* what, const Json& cases) {
  std::string out = std::string("{\"what\": ") + Json(what).dump() + ",\n \"cases\": [\n";
  for (std::size_t i = 0; i < cases.size(); ++i)
    out += "  " + cases[i].dump() + (i + 1 < cases.size() ? ",\n" : "\n");
  return out + "]}\n";
}

void expect_file(const char* name, const char* what, const Json& cases) {
  const std::string path = kRoot + "/delivery/vectors/" + name, text = text_of(what, cases);
  ASSERT_GT(cases.size(), 0u);
  if (std::getenv("TEXMESH_WRITE_VECTORS")) {
    std::ofstream(path, std::ios::binary) << text;
    return;
  }
  std::ifstream in(path, std::ios::binary);
  std::ostringstream there;
  there << in.rdbuf();
  // Not EXPECT_EQ: a megabyte of text helps nobody.
  EXPECT_TRUE(there.str() == text) << path << " differs from what the library decides today; "
                                   << "TEXMESH_WRITE_VECTORS=1 writes it anew";
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
TEST(Vectors, Packages) {
  expect_file("packages.json",
              "what a client reads and works out from a package, relative to the project's root", packages());
}

}  // namespace
}  // namespace texmesh
