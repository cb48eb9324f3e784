// texmesh-lab simulate: every policy, order and estimator over a model of a network, with test packets,
// several objects or lost packets; and Theorem 4.1.
#include <fmt/format.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "lab/cli/commands.h"
#include "lab/transfer/chapter_4.h"
#include "lab/transfer/packet_loss.h"
#include "lab/transfer/policies.h"
#include "lab/transfer/probes.h"
#include "lab/transfer/several_objects.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/table.h"
#include "pipeline/io/uri.h"
#include "stages/condition/condition.h"
#include "stages/image/png_writer.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/render/rendered_model.h"

namespace texmesh {

template <>
struct EnumNames<LabPolicy> {
  static constexpr std::array<std::string_view, 6> names{"htca",         "guard",  "price",
                                                         "proportional", "static", "thesis"};
};
template <>
struct EnumNames<HtcOrder> {
  static constexpr std::array<std::string_view, 3> names{"credit", "beta0", "finest"};
};
template <>
struct EnumNames<Estimator> {
  static constexpr std::array<std::string_view, 3> names{"last", "harmonic", "ewma"};
};
template <>
struct EnumNames<ProbeMode> {
  static constexpr std::array<std::string_view, 3> names{"off", "fixed", "adaptive"};
};

namespace {

using Json = nlohmann::ordered_json;

/// A package beside the first one.
struct BesideObject {
  std::string package;
  double displayed_px = 0;  // 0 = as the first one
};

struct SimulateArguments : DeliveryArguments {
  LabOptions method{.policy = LabPolicy::kGuard};
  std::optional<HtcOrder> order;       // not given: the policy's
  std::optional<Estimator> estimator;  // the same
  int window = 0;
  bool hard_limits = false;
  ProbeOptions probe;
  std::vector<std::string> beside;
  bool no_repeat = false, theorem = false, csv = false;
  std::string plot, picture;
  int seeds = 20;
};

/// Prints one table in the form that was asked for; `about` has the members of the document beside the rows.
void print_table(const SimulateArguments& a, const Table& table, Json about, const std::string& above,
                 const std::string& below = {}) {
  about["rows"] = table.json();
  if (a.json)
    std::cout << about.dump() << '\n';
  else
    std::cout << (a.csv ? table.csv() : above + table.text() + below);
}

// ---- chapter 4

/// What of the theorem holds over all runs.
struct TheoremSummary {
  double identity_error = 0, largest_surplus_s = 0;  // the error as a share of T_0
  int corrected_broken = 0, published_broken = 0;
  void add(const HtcTheorem& t) {
    const double surplus = std::abs(t.surplus_s);
    identity_error = std::max(identity_error, std::abs(t.surplus_s - t.last_residual_s) / kTheoremLimit_s);
    largest_surplus_s = std::max(largest_surplus_s, surplus);
    corrected_broken += surplus > t.corrected_bound_s * (1 + 1e-9) + 1e-8;
    published_broken += surplus > std::abs(t.published_bound_s) + 1e-8;
  }
};

void print_theorem(const SimulateArguments& a) {
  constexpr int kShown = 10;
  const std::vector<FragmentOffer> offers = table_4_2_offers();
  const HtcOptions options = chapter_options(a.order.value_or(HtcOrder::kCredit));
  const int runs = 50 * a.seeds;
  Table table{"",
              {{"run", 0, "run"},
               {"Pi", 6, "surplus_s", "s"},
               {"dT_n", 6, "last_residual_s", "s"},
               {"corrected bound", 6, "corrected_bound_s", "s"},
               {"published", 6, "published_bound_s", "s"}}};
  TheoremSummary sum;
  for (int run = 1; run <= runs; ++run) {
    const HtcTheorem t = theorem_run(options, offers, run, runs);
    sum.add(t);
    table.row({run, t.surplus_s, t.last_residual_s, t.corrected_bound_s, t.published_bound_s});
  }
  if (!a.json && !a.csv) {  // some of them
    std::vector<std::vector<Cell>> shown;
    for (int i = 0; i < kShown; ++i)
      shown.push_back(table.rows[static_cast<std::size_t>((2 * i + 1) * runs / (2 * kShown))]);
    table.rows = std::move(shown);
  }
  print_table(
      a, table,
      {{"version", 1},
       {"runs", runs},
       {"identity_error", sum.identity_error},
       {"largest_surplus_s", sum.largest_surplus_s},
       {"corrected_bound_broken", sum.corrected_broken},
       {"published_bound_broken", sum.published_broken}},
      fmt::format(
          "{} runs of 256 fragments over random links, T_0 = {:.0f} s; some of them (--csv, --json: all):\n",
          runs, kTheoremLimit_s),
      fmt::format(
          "  Pi = dT_n                     largest error {:.1e} of T_0\n"
          "  largest |Pi|                  {:.4f} s\n"
          "  corrected bound               theta_n |beta_(n-1) / beta_n - 1| + rounding: broken in {} runs\n"
          "  Theorem 4.1 as published      broken in {} runs (its proof drops a term; a diagnostic only)\n",
          sum.identity_error, sum.largest_surplus_s, sum.corrected_broken, sum.published_broken));
}

// ---- lost packets

/// The stream of a package up to a scale.
struct ScaleStream {
  SplitStreamHead head;
  Bytes bytes;
  std::size_t index = 0;
  LossyMesh decode(const PacketLoss& loss, SplitFill fill) const {
    return mesh_with_losses(head, bytes, index,
                            loss.loss > 0 ? lost_position_parts(head, loss) : std::vector<bool>{}, fill);
  }
};

ScaleStream stream_to(PackageReader& package, int scale) {
  ScaleStream s{package.split_stream_head(), package.entry(kSplitStreamPath), 0};
  const auto it = std::ranges::find(s.head.scales, scale, &SplitScale::scale);
  if (it == s.head.scales.end())
    throw InputError("--scale", "", "a scale that the vertex splits pass", std::to_string(scale));
  s.index = static_cast<std::size_t>(it - s.head.scales.begin());
  return s;
}

Mesh clay(const SplitStreamHead& head, const SplitMesh& from) {
  Mesh mesh;
  for (const SplitMesh::Point& p : from.points())
    mesh.positions.push_back(
        {head.position.value(p[0], 0), head.position.value(p[1], 1), head.position.value(p[2], 2)});
  for (std::uint32_t p = 0; p < mesh.positions.size(); ++p) mesh.wedge_position.push_back(p);
  for (const std::uint32_t f : from.visible_faces())
    mesh.triangles.push_back({from.point_at(f, 0), from.point_at(f, 1), from.point_at(f, 2)});
  mesh.triangle_material.assign(mesh.triangles.size(), 0);
  mesh.triangle_part.assign(mesh.triangles.size(), 0);
  mesh.part_names = {"object"};
  return mesh;
}

/// What lost packets cost that nobody sends again (thesis ch. 10), for the scale and the fragments of a plan:
/// none, a half, all, twice the rate that was asked for.
Table lost_packets(const ScaleStream& stream, const SplitMesh& whole, std::size_t fragments,
                   PackageReader& package, const DeliveryPlan& plan, const FragmentList& list,
                   const DeliveryRequest& request, double loss) {
  Table table{"",
              {{"packets lost", percent_form(), "loss", "%"},
               {"lost points", kGrouped, "lost_points"},
               {"neighbours: rms", 3, "neighbours_rms_edges", "edges"},
               {"texture: rms", 3, "texture_rms_edges", "edges"},
               {"p95", 3, "texture_p95_edges", "edges"},
               {"lost fragments", kGrouped, "lost_fragments"},
               {"FLIP", 4, "flip"}}};
  for (const double factor : {0.0, 0.5, 1.0, 2.0}) {
    const PacketLoss packets{.loss = std::min(1.0, factor * loss), .seed = request.network.seed};
    const LossyMesh texture = stream.decode(packets, SplitFill::kTexture);
    const PointErrors errors = point_errors(whole, texture);
    const std::vector<std::int32_t> rungs =
        packets.loss > 0 ? rungs_after_loss(list.offers, plan.textures.rungs, packets) : plan.textures.rungs;
    const auto left = std::ranges::count_if(rungs, [](std::int32_t rung) { return rung >= 0; });
    table.row({packets.loss, texture.lost_points.size(),
               point_errors(whole, stream.decode(packets, SplitFill::kNeighbours)).rms, errors.rms,
               errors.p95, fragments - static_cast<std::size_t>(left),
               picture_flip(package.quality(), request.displayed_px, plan.scale, losses_of(list, rungs))});
  }
  return table;
}

/// The scale as clay, three times side by side: nothing lost; lost points at the mean of their neighbours; at
/// the places that their texture coordinates suggest. PNG.
std::vector<std::uint8_t> lost_packets_picture(PackageReader& package, int scale, double loss,
                                               std::uint64_t seed) {
  constexpr std::uint32_t kSide_px = 512;
  const RunContext context;
  const ScaleStream stream = stream_to(package, scale);
  const RenderEnvironment light = environment_of(RenderLight::kStudio, context);
  Material material;
  material.base_colour = {0.6f, 0.6f, 0.6f, 1};
  material.metallic = 0;
  material.roughness = 0.6f;
  material.double_sided = true;
  Pixels out{3 * kSide_px, kSide_px, 3, std::vector<std::uint8_t>(std::size_t{9} * kSide_px * kSide_px)};
  BoundingSphere bounds;
  for (std::uint32_t k = 0; k < 3; ++k) {
    const LossyMesh lossy = stream.decode({.loss = k == 0 ? 0 : loss, .seed = seed},
                                          k == 1 ? SplitFill::kNeighbours : SplitFill::kTexture);
    Mesh mesh = condition_mesh(clay(stream.head, lossy.mesh), false, {}, context).mesh;
    RenderedModel model = untextured_model(std::move(mesh), {material});
    if (k == 0) bounds = model.bounds;
    model.bounds = bounds;  // one camera for all
    const Pixels view = render_sheet(model, light, 1, kSide_px, context).pixels;
    paste(view, k * kSide_px, 0, out);
  }
  return write_png(out);
}

/// Lost packets that nobody sends again take no time, but what was in them.
void simulate_lost_packets(const SimulateArguments& a, DeliveryRequest request) {
  const double loss = std::exchange(request.network.loss, 0);
  if (!(loss > 0)) throw UsageError("--no-repeat", "", "--loss above 0", "none");
  if (!a.picture.empty()) check_output_file(a.picture);
  PackageReader package(open_store(a.package));
  const DeliveryPlan plan = plan_delivery(package, request);
  if (plan.proxy)
    throw InputError("--no-repeat", "", "a scale (--scale), whose mesh is a stream of vertex splits",
                     "a proxy");
  const FragmentList list = list_of(package, request, plan);
  const ScaleStream stream = stream_to(package, plan.scale);
  const SplitMesh whole = stream.decode({}, SplitFill::kNeighbours).mesh;
  const auto fragments = static_cast<std::size_t>(
      std::ranges::count_if(plan.textures.rungs, [](std::int32_t rung) { return rung >= 0; }));
  const Table table = lost_packets(stream, whole, fragments, package, plan, list, request, loss);
  if (!a.picture.empty())
    write_output_file(a.picture, lost_packets_picture(package, plan.scale, loss, request.network.seed));
  print_table(
      a, table, {{"version", 1}, {"points", whole.points().size()}, {"fragments", fragments}},
      fmt::format(
          "lost packets are not sent again, as over UDP; HTTP loses none. Of {} points and {} fragments:\n",
          grouped(whole.points().size()), grouped(fragments)),
      "lost points stand where their texture coordinates lie among their neighbours' (chapter 10), or at the mean of "
      "these;\nlost fragments show their preview. FLIP is predicted of the textures; it does not see the points\n");
}

// ---- several objects

/// "PKG" or "PKG,PX" with its displayed height. UsageError for a height out of 1 .. 1e6.
BesideObject beside_object(const std::string& text) {
  const std::size_t comma = text.rfind(',');
  if (comma == std::string::npos) return {text, 0};
  double px = 0;
  const char* end = text.data() + text.size();
  const auto [stop, error] = std::from_chars(text.data() + comma + 1, end, px);
  if (error != std::errc() || stop != end) return {text, 0};  // a comma of the name
  if (!(px >= 1 && px <= 1e6)) throw UsageError("--beside", "", "a displayed height from 1 to 1e6 px", text);
  return {text.substr(0, comma), px};
}

/// Plays several objects that share one link and one time limit.
void simulate_page(const SimulateArguments& a, const DeliveryRequest& request) {
  std::vector<BesideObject> objects{{a.package, request.displayed_px}};
  for (const std::string& text : a.beside) {
    objects.push_back(beside_object(text));
    if (objects.back().displayed_px <= 0) objects.back().displayed_px = request.displayed_px;
  }
  std::vector<std::unique_ptr<PackageReader>> packages;
  std::vector<PageObject> page;
  for (const BesideObject& o : objects) {
    packages.push_back(std::make_unique<PackageReader>(open_store(o.package)));
    page.push_back({packages.back().get(), o.displayed_px, page.empty() ? request.scale : -1});
  }
  const PagePlan plan = plan_page(page, request);
  Table table{"",
              {{"object", {}, "package"},
               {"px", 0, "display_px"},
               {"shows"},
               Column::data("scale"),
               Column::data("proxy"),
               Column::data("first_picture_only"),
               {"bytes", kGrouped, "bytes"},
               {"FLIP", 4, "flip"},
               {"by itself", 4, "alone_flip"}}};
  for (std::size_t i = 0; i < objects.size(); ++i) {
    const DeliveryPlan& p = plan.objects[i];
    const bool picture_only = plan.first_picture_only[i];
    table.row({readable_name(objects[i].package), objects[i].displayed_px,
               picture_only ? "first picture"
               : p.proxy    ? fmt::format("proxy {}", *p.proxy)
                            : fmt::format("S_{}", p.scale),
               p.scale, p.proxy, picture_only, p.bytes(), p.flip, plan.alone_flip[i]});
  }
  const double limit_s = request.time_limit_s, off = 100 * (limit_s - plan.complete_s) / limit_s;
  if (a.json) {
    std::cout << Json{{"version", 1},
                      {"objects", table.json()},
                      {"first_pictures_s", plan.first_pictures_s},
                      {"meshes_s", plan.meshes_s},
                      {"complete_s", plan.complete_s},
                      {"whole_limit_s", limit_s},
                      {"whole_deviation_percent", off},
                      {"flip", plan.flip},
                      {"alone_flip", plan.alone_mean_flip}}
                     .dump()
              << '\n';
    return;
  }
  std::cout << fmt::format(
      "{}all first pictures {}, all meshes {}, textures {}: deviation {:+.2f} % of {:.2f} s\n"
      "predicted FLIP over the pixels of all {:.4f}; with a part of the link to each by itself {:.4f}\n",
      table.text(), moment(plan.first_pictures_s), moment(plan.meshes_s), moment(plan.complete_s), off,
      limit_s, plan.flip, plan.alone_mean_flip);
}

// ---- one package

/// Every decision as a line.
std::string steps_csv(const DeliveryPlan& p, const FragmentList& list, const std::vector<double>& qualities) {
  Table table;
  for (const char* key : {"position", "plane", "fragment", "rung", "quality", "bytes", "theta_s", "credit_s",
                          "target_bytes", "throughput_bytes_s", "issued_s", "done_s", "residual_s"})
    table.column(Column::data(key));
  for (std::size_t i = 0; i < p.textures.steps.size(); ++i) {
    const HtcStep& s = p.textures.steps[i];
    table.row({s.position, list.fragments[s.offer].plane, list.fragments[s.offer].fragment, s.rung,
               qualities[i], s.bytes, s.theta_s, s.credit_s, s.target_bytes, s.throughput_bytes_s, s.issued_s,
               s.done_s, s.residual_s});
  }
  return table.csv();
}

/// Mean relative error of the test packets against the link, which they measured from `start_s` on.
double mean_probe_error(const ProbeResult& probes, const BandwidthTrace& link, double start_s) {
  double sum = 0;
  for (const BandwidthSample& s : probes.samples) {
    const double to = start_s + s.time_s, truth = link.mean(to - s.seconds, to);
    if (truth > 0) sum += std::abs(s.bytes_s / truth - 1);
  }
  return probes.samples.empty() ? 0 : sum / static_cast<double>(probes.samples.size());
}

void simulate_package(const SimulateArguments& a, DeliveryRequest request) {
  std::map<int, ProbeResult> probes_of;  // by scale
  if (a.probe.mode != ProbeMode::kOff)
    request.play = [&](int scale, const std::vector<FragmentOffer>& offers, const HtcOptions& htc,
                       const NetworkOptions& network) {
      return simulate_with_probes(offers, htc, network, a.probe, probes_of[scale]);
    };
  PackageReader package(open_store(a.package));
  const DeliveryPlan plan = plan_delivery(package, request);
  const ProbeResult probes = plan.proxy ? ProbeResult{} : probes_of[plan.scale];
  const FragmentList list = list_of(package, request, plan);
  const std::vector<double> qualities = simulated_qualities(package, plan, list);
  if (!a.plot.empty())
    write_simulation_plot(a.plot, fmt::format("{}, {}", a.package, enum_name(a.method.policy)), plan,
                          qualities, request.network.link);
  if (a.csv) {
    std::cout << steps_csv(plan, list, qualities);
    return;
  }
  const double error = mean_probe_error(probes, request.network.link, plan.mesh_s);
  if (a.json) {
    Json j = to_json(SimulatedDelivery{plan, request.time_limit_s});
    if (probes.packets > 0)
      j["probes"] = {{"packets", probes.packets},
                     {"bytes", probes.bytes},
                     {"arrived", probes.samples.size()},
                     {"mean_error", error}};
    std::cout << j.dump() << '\n';
    return;
  }
  std::cout << simulated_text(plan, request.time_limit_s);
  if (probes.packets > 0)
    std::cout << fmt::format("{} test packets with {} bytes beside the textures; mean error {:.1f} %\n",
                             probes.packets, grouped(probes.bytes), 100 * error);
}

/// "2Mbit/s", "2Mbit/s,dead=3.5s", "2Mbit/s,lies=0s".
MirrorModel mirror_of(const std::string& text) {
  MirrorModel m;
  const std::size_t comma = text.find(',');
  m.rate = BandwidthTrace::constant(parse_bandwidth(text.substr(0, comma), "--mirror"));
  if (comma == std::string::npos) return m;
  const std::string rest = text.substr(comma + 1);
  const bool dies = rest.starts_with("dead="), lies = rest.starts_with("lies=");
  if (!dies && !lies) throw UsageError("--mirror", "", "RATE, RATE,dead=SECONDS or RATE,lies=SECONDS", text);
  (dies ? m.dead_from_s : m.lies_from_s) = parse_duration(rest.substr(5), "--mirror");
  return m;
}

/// The request, with any policy.
DeliveryRequest lab_request(const SimulateArguments& a) {
  DeliveryArguments args = a;
  const std::vector<std::string> mirrors = std::exchange(args.mirrors, {});
  args.request.htc.policy = a.method.policy == LabPolicy::kThesis ? Policy::kThesis : Policy::kGuard;
  DeliveryRequest r = delivery_request(args);
  if (!mirrors.empty()) r.network.mirrors.clear();
  for (const std::string& m : mirrors) r.network.mirrors.push_back(mirror_of(m));
  if (a.window > 0) r.htc.window = a.window;
  if (a.hard_limits) r.htc.hard_limits = true;
  LabOptions method = a.method;
  method.order = a.order.value_or(default_order(method.policy));
  method.estimator = a.estimator.value_or(default_estimator(method.policy));
  use_policy(method, r.htc);
  return r;
}

int run_simulate(const SimulateArguments& a) {
  if (a.theorem != a.package.empty())
    throw UsageError("PACKAGE", "", "a package, or --theorem", a.theorem ? a.package : "none of them");
  if (a.theorem) {
    print_theorem(a);
    return kExitOk;
  }
  if (!a.beside.empty() && a.probe.mode != ProbeMode::kOff)
    throw UsageError("--beside", "", "no --probe with it", std::string(enum_name(a.probe.mode)));
  const DeliveryRequest request = lab_request(a);
  if (a.no_repeat)
    simulate_lost_packets(a, request);
  else if (!a.beside.empty())
    simulate_page(a, request);
  else
    simulate_package(a, request);
  return kExitOk;
}

void add_network_options(Command& c, SimulateArguments& a) {
  add_link_options(c, a);
  NetworkOptions& network = a.request.network;
  c.option("--mirror", a.mirrors,
           "A server's own rate, 2Mbit/s; with ,dead=3s it dies then, with ,lies=3s its bytes are wrong from "
           "then on; several times for several servers",
           "RATE");
  c.flag("--connect-costs", network.connect_costs, "A connection's first request takes another round trip")
      .rare();
  c.flag("--slow-start", network.slow_start, "Connections begin slowly, as TCP's do").rare();
  c.option("--loss", network.loss, "Share of packets lost").number_in(0, 0.5).shows_default().rare();
  c.option("--seed", network.seed, "Seed of lost packets").shows_default().rare();
}

void add_method_options(Command& c, SimulateArguments& a) {
  c.group("Method");
  c.choice(
       "--policy", a.method.policy,
       "htca = the thesis's method; guard = htca around the plan of least loss, with sizes within a factor of 1.5 of "
       "that plan's share; price = one price of bytes, which rises when the transfer is late; proportional = planned "
       "sizes scaled by the time left; static = planned sizes, always; thesis = chapters 4 and 7 as printed: htca "
       "with --rule distance, --order beta0, --window 1, --hard-limits and the list that T_0 beta_0 pays")
      .shows_default("guard");
  c.choice(
      "--order", a.order,
      "Next fragment: credit = by the sign of the credit; beta0 = by the throughput, as first published; finest "
      "= always the finest. Default: finest with --policy guard, beta0 with thesis, else credit");
  c.choice(
      "--estimator", a.estimator,
      "Throughput: last = of the last transfer; harmonic = harmonic mean of several; ewma = mean that forgets "
      "older transfers. Default: harmonic with --policy price, proportional and static, else last");
  c.option("--samples", a.method.samples, "Transfers that the harmonic mean takes")
      .integer_in(1, 64)
      .shows_default();
  c.option(
      "--beta0",
      [&a](const std::string& text) { a.request.beta0_bytes_s = parse_bandwidth(text, "--beta0"); },
      "First guess of the throughput (default: what the mesh's transfer has shown)", "RATE");
  c.option("--window", a.window, "Requests in flight; 0 = by throughput and round trip")
      .integer_in(0, 64)
      .shows_default();
  c.flag(
      "--hard-limits", a.hard_limits,
      "Qualities stay within 5 .. 97 and no fragment is skipped, however late the transfer is (default: only "
      "while there is time enough)");
  add_rule_option(c, a);
}

/// An option whose value lies from `least` to `most`, as `range` says.
Option bounded_option(Command& c, const std::string& flag, auto parse, double least, double most,
                      const char* range, double& value, const std::string& help, const char* unit) {
  return c.option(
      flag,
      [=, &value](const std::string& text) {
        value = static_cast<double>(parse(text, flag));
        if (!(value >= least && value <= most)) throw UsageError(flag, "", range, text);
      },
      help, unit);
}

void add_probe_options(Command& c, ProbeOptions& probe) {
  c.group("Test packets");
  c.choice(
       "--probe", probe.mode,
       "Test packets beside the textures, which measure the link and cost a part of it: fixed = of one size at "
       "regular intervals; adaptive = half as large and as frequent below a threshold, twice from it on")
      .shows_default("off");
  bounded_option(c, "--probe-size", parse_bytes, 64, 1 << 24, "64 B to 16 MiB", probe.packet_bytes,
                 "A test packet, of adaptive ones the first: 64 B to 16 MiB", "BYTES")
      .shows_default("8kB");
  bounded_option(c, "--probe-interval", parse_duration, 0.01, 3600, "10 ms to an hour", probe.interval_s,
                 "From one test packet to the next: 10 ms to an hour", "TIME")
      .shows_default("500ms");
  bounded_option(c, "--probe-threshold", parse_bandwidth, std::numeric_limits<double>::min(), HUGE_VAL,
                 "a rate above 0", probe.threshold_bytes_s, "The threshold of adaptive test packets", "RATE")
      .shows_default("1Mbit/s");
}

void add_play_options(Command& c, SimulateArguments& a) {
  c.group("What is played");
  Option beside = c.option(
      "--beside", a.beside,
      "Another package that shares link and time limit, and its displayed height in px; may be given again",
      "PKG[,PX]");
  c.flag(
       "--no-repeat", a.no_repeat,
       "Packets of --loss are not sent again: a table of what that costs mesh and textures (HTTP sends them again)")
      .excludes(beside);
  c.option("--picture", a.picture,
           "With --no-repeat: a PNG of the mesh as it should be, with lost points at the mean of their "
           "neighbours, and by their texture coordinates",
           "FILE");
  c.flag("--theorem", a.theorem, "What Theorem 4.1 says and what holds, over random links");
  c.option("--seeds", a.seeds, "Of --theorem: 50 runs each").integer_in(1, 10000).shows_default();
}

}  // namespace

void add_lab_simulate_command(Command& app) {
  auto [c, args] =
      app.add("simulate", "Play any policy over a model of a network, and Theorem 4.1", run_simulate);
  args.probe.packet_bytes = 8000, args.probe.threshold_bytes_s = 125e3;
  add_package_and_view_options(c, args, false);
  c.option("--plot", args.plot, "Write an SVG: quality and time by fragment, throughput, credit", "FILE");
  Option json =
      c.flag("--json", args.json, "Print one JSON object (lab/schemas/lab-simulate.v1.schema.json)");
  c.flag("--csv", args.csv, "Print every decision, run or row as a line").excludes(json);
  add_network_options(c, args);
  add_method_options(c, args);
  add_probe_options(c, args.probe);
  add_play_options(c, args);
  c.examples(
      "  texmesh-lab simulate bust.texmesh --time 5 --bandwidth 2Mbit/s --rtt 50 --policy htca\n"
      "  texmesh-lab simulate bust.texmesh --bandwidth 2Mbit/s --mirror 1Mbit/s --mirror 1Mbit/s,dead=2s\n"
      "  texmesh-lab simulate bust.texmesh --display 600 --beside vase.texmesh,200 --time 3 --bandwidth 4Mbit/s\n"
      "  texmesh-lab simulate bust.texmesh --bandwidth 2Mbit/s --loss 0.05 --no-repeat --picture lost.png\n"
      "  texmesh-lab simulate --theorem --json");
  c.notes(
      "The deviation is a share of the time limit. It is positive when the transfer ended early. --theorem "
      "plays the method itself and takes --order, --seeds and the form of the output only.\n"
      "Exit code: 0, 1 when the package or the trace cannot be read, 2 usage.");
}

}  // namespace texmesh
