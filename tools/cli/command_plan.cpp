#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "pipeline/io/table.h"
#include "tools/cli/check/check_gate.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/delivery_options.h"

namespace texmesh {
namespace {

struct PlannedPlane {
  PlaneChoice choice;
  std::vector<std::uint8_t> rung_quality;
  std::vector<OrNull<std::int32_t>> rungs;
  static void fields(auto& s, auto&& v) {
    v("texture", s.choice.base, "Full-size plane that is shown.");
    v("plane", s.choice.plane, "The plane that is fetched for it: itself or one of its mips.");
    v("rung_quality", s.rung_quality, FieldRule{.range = Range{1, 100}, .count = Range{1, 100}},
      "Quality of each rung of that plane, rising.");
    v("rungs", s.rungs, Range{-1, 99},
      "By fragment, row by row: index of its rung, -1 = skipped, null = nothing is stored there.");
  }
};

std::vector<PlannedPlane> planned_planes(PackageReader& package, const DeliveryPlan& p,
                                         const FragmentList& list) {
  std::vector<PlannedPlane> planes;
  for (const PlaneChoice& c : p.planes) {
    const PlaneTables& t = package.tables().planes[c.plane];
    planes.push_back({c, t.rung_quality, std::vector<OrNull<std::int32_t>>(t.fragment_count())});
    for (std::size_t i = 0; i < list.fragments.size(); ++i)
      if (list.fragments[i].plane == c.plane)
        planes.back().rungs[list.fragments[i].fragment].value = p.textures.rungs[i];
  }
  return planes;
}

struct PlannedBytes {
  std::uint64_t bootstrap = 0, first_picture = 0, step = 0, mesh = 0, tables = 0, texture = 0, all = 0;
  static void fields(auto& s, auto&& v) {
    v("bootstrap", s.bootstrap, "");
    v("first_picture", s.first_picture, "");
    v("step", s.step, "");
    v("mesh", s.mesh, "");
    v("tables", s.tables, "");
    v("texture", s.texture, "");
    v("all", s.all, "");
  }
};

/// What plan --json and check --json print. A plan of a budget has no times.
struct PlanDocument {
  DeliveryPlan plan;
  std::vector<PlannedPlane> planes;
  bool timed = true;
  std::optional<bool> good = {};
  std::optional<std::vector<std::string>> reasons = {};
  std::optional<OrNull<double>> time(double time_s) const {
    return timed ? std::optional(finite(time_s)) : std::nullopt;
  }
  std::optional<ShownStep> step() const {
    return plan.step ? std::optional(ShownStep{*plan.step, plan.step_s}) : std::nullopt;
  }
  static void fields(auto& s, auto&& v) {
    const DeliveryPlan& p = s.plan;
    v("version", Constant{1}, "");
    v("scale", p.scale, kScaleNumbers,
      "Number of the mesh scale that is shown at the end; with `proxy` the coarsest one, which is not.");
    v("planes", s.planes, "");
    v("first_picture_s", s.time(p.first_picture_s), kSeconds,
      "Seconds from the first request, as mesh_s and complete_s; null = never; not with --budget.");
    v("mesh_s", s.time(p.mesh_s), kSeconds, "");
    v("complete_s", s.time(p.complete_s), kSeconds, "");
    v("bytes",
      PlannedBytes{p.bootstrap_bytes, p.first_picture_bytes, p.step_bytes, p.mesh_bytes, p.table_bytes,
                   p.texture_bytes, p.bytes()},
      "");
    v("gpu_bytes", p.gpu, "What is shown takes at most so much on the GPU.");
    v("fragments", p.textures.rungs.size(), "In the planes that are fetched.");
    v("skipped", p.textures.skipped, "Of those, the ones that stay with the preview.");
    v("mean_quality", p.mean_quality, kQualities, "");
    v("worst_quality", p.worst_quality, kQualities, "");
    v("texture_flip", p.texture_flip, kFlips, "Predicted FLIP of the finest scale with these textures.");
    v("flip", p.flip, kFlips, kFlipMeans);
    v("warnings", p.warnings, "");
    v("proxy", p.proxy, kProxyNumbers, "The proxy that is shown instead of a scale; 0 = the smallest.");
    v("step", s.step(),
      "The larger proxy that is shown before documents and mesh come, and when it is there; its bytes are "
      "bytes.step.");
    v("good", s.good, "check only: every limit is kept.");
    v("reasons", s.reasons, "check only: the limits that are not.");
  }
};

/// What is shown at the end.
std::string shown_text(const DeliveryPlan& p) {
  return p.proxy ? proxy_path(*p.proxy) : fmt::format("S_{}", p.scale);
}

/// How many fragments get which quality: "12 x 30, 40 x 53".
std::string rungs_text(PackageReader& package, const DeliveryPlan& p, const FragmentList& list) {
  std::map<int, int> count;
  for (std::size_t i = 0; i < list.fragments.size(); ++i)
    if (const std::int32_t r = p.textures.rungs[i]; r >= 0)
      ++count[package.tables().planes[list.fragments[i].plane].rung_quality[static_cast<std::size_t>(r)]];
  std::string text;
  for (const auto& [quality, n] : count)
    text += fmt::format("{}{} x {}", text.empty() ? "" : ", ", n, quality);
  return text;
}

std::string textures_text(PackageReader& package, const DeliveryPlan& p, const FragmentList& list) {
  std::string text = gpu_text(p.gpu);
  if (p.step)
    text += fmt::format("on the way: {} {} ({} bytes)\n", proxy_path(*p.step), moment(p.step_s),
                        grouped(p.step_bytes));
  if (!p.textures.rungs.empty())
    text += fmt::format("fragments: {}, {} skipped; quality {:.0f} in the mean, {:.0f} at worst\n",
                        p.textures.rungs.size(), p.textures.skipped, p.mean_quality, p.worst_quality);
  if (const std::string rungs = rungs_text(package, p, list); !rungs.empty())
    text += "rungs (fragments x quality): " + rungs + "\n";
  for (const std::string& w : p.warnings) text += "note: " + w + "\n";
  return text;
}

/// `timed`: of a plan over a link, not of a budget.
std::string plan_text(PackageReader& package, const DeliveryPlan& p, const FragmentList& list, bool timed) {
  std::string text =
      fmt::format("{}, predicted FLIP {:.4f} (0 = equal to the source){}\n", shown_text(p), p.flip,
                  p.proxy ? "" : fmt::format(", {:.4f} by the textures alone", p.texture_flip));
  if (timed)
    text += fmt::format("first picture {} ({} bytes), mesh complete {}, textures {}\n",
                        moment(p.first_picture_s), grouped(p.bootstrap_bytes + p.first_picture_bytes),
                        moment(p.mesh_s), moment(p.complete_s));
  text += fmt::format("bytes: {} start, {} first picture, {} mesh, {} tables, {} textures; {} in all\n",
                      grouped(p.bootstrap_bytes), grouped(p.first_picture_bytes), grouped(p.mesh_bytes),
                      grouped(p.table_bytes), grouped(p.texture_bytes), grouped(p.bytes()));
  return text + textures_text(package, p, list);
}

struct PlanArguments : DeliveryArguments {
  std::optional<std::uint64_t> budget;  // bytes
};

struct CheckArguments : DeliveryArguments {
  Gate gate;
  std::string junit;
  int views = 12;
  bool predicted_only = false;
};

int run_plan(PlanArguments& args) {
  args.needs_link = !args.budget;
  const DeliveryRequest request = delivery_request(args);
  PackageReader package(open_store(args.package));
  const DeliveryPlan plan =
      args.budget ? plan_budget(package, request, *args.budget) : plan_delivery(package, request);
  const FragmentList list = list_of(package, request, plan);
  if (args.json) {
    const std::vector<PlannedPlane> planes = planned_planes(package, plan, list);
    std::cout << to_json_line(PlanDocument{plan, planes, !args.budget}) << '\n';
  } else {
    std::cout << plan_text(package, plan, list, !args.budget);
  }
  return !args.budget || plan.bytes() <= *args.budget ? kExitOk : kExitDifferent;
}

int run_check(const CheckArguments& args) {
  const DeliveryRequest request = delivery_request(args);
  PackageReader package(open_store(args.package));
  const DeliveryPlan plan = plan_delivery(package, request);
  const FragmentList list = list_of(package, request, plan);
  std::vector<GateResult> results = check_plan(plan, args.gate, request.time_limit_s);
  if (args.gate.max_flip < 1 && !args.predicted_only) {
    const PercentLine progress("check");
    const auto sizes = check_switch_sizes(package, args.gate.max_flip, args.views, context_of(0));
    results.insert(results.end(), sizes.begin(), sizes.end());
  }
  write_gate_junit(args.junit, "texmesh check", args.package, results);
  const std::vector<std::string> reasons = gate_failures(results);
  if (args.json) {
    const std::vector<PlannedPlane> planes = planned_planes(package, plan, list);
    std::cout << to_json_line(PlanDocument{plan, planes, true, reasons.empty(), reasons}) << '\n';
  } else {
    std::cout << plan_text(package, plan, list, true) << gate_text(results);
    if (args.gate.max_flip >= 1 && args.gate.max_texture_flip >= 1)
      std::cout << "note: no limit of quality was given; --max-flip 0.1 sets one\n";
  }
  return reasons.empty() ? kExitOk : kExitDifferent;
}

struct SimulateArguments : DeliveryArguments {
  std::string plot;
};

int run_simulate(const SimulateArguments& a) {
  const DeliveryRequest request = delivery_request(a);
  PackageReader package(open_store(a.package));
  const DeliveryPlan plan = plan_delivery(package, request);
  if (!a.plot.empty()) {
    const FragmentList list = list_of(package, request, plan);
    write_simulation_plot(a.plot, a.package, plan, simulated_qualities(package, plan, list),
                          request.network.link);
  }
  std::cout << (a.json ? to_json_line(SimulatedDelivery{plan, request.time_limit_s}) + '\n'
                       : simulated_text(plan, request.time_limit_s));
  return kExitOk;
}

}  // namespace

DocumentSchema plan_schema() {
  Json body = schema_of<PlanDocument>();
  body["dependencies"] = {{"first_picture_s", {"mesh_s", "complete_s"}},
                          {"mesh_s", {"first_picture_s", "complete_s"}},
                          {"complete_s", {"first_picture_s", "mesh_s"}},
                          {"good", {"reasons", "complete_s"}},
                          {"reasons", Json::array({"good"})}};
  return document_schema("plan.v1", "texmesh plan, version 1",
                         "Output of `texmesh plan PKG --json` and `texmesh check PKG --json`: what a client "
                         "would fetch within a time or a budget of bytes, and what that would look like.",
                         body);
}

DocumentSchema simulate_schema() {
  return document_schema(
      "simulate.v1", "texmesh simulate, version 1",
      "Output of `texmesh simulate --json`: a transfer of a package, played over a link. Times in seconds.",
      schema_of<SimulatedDelivery>());
}

void add_plan_command(Command& app) {
  auto [c, args] =
      app.add("plan", "Say what a viewer will get in a time over a link, or in a number of bytes", run_plan);
  add_delivery_options(c, args);
  c.option("--budget", args.budget, parse_bytes,
           "Bytes instead of time: the mesh and the textures that look best together in 500kB", "SIZE");
  c.flag("--json", args.json, "Print one JSON object (schemas/plan.v1.schema.json)");
  c.examples(
      "  texmesh plan bust.texmesh --display 800 --time 3 --bandwidth 2Mbit/s --rtt 40\n"
      "  texmesh plan https://host/bust.texmesh --display 400 --time 1.5 --trace monday.csv --rtt 80\n"
      "  texmesh plan bust.texmesh --display 800 --budget 500kB\n"
      "  texmesh plan bust.texmesh --display 2000 --time 5 --bandwidth 20Mbit/s --memory 64MB");
  c.notes(
      "plan plays the transfer over a model of the network and needs nothing but the package. FLIP is "
      "how much a lit picture of that height differs from one of the source, in the mean over the object: 0 "
      "= equal, 1 = as different as can be. It comes from the table that compile measured.\n"
      "A proxy is the whole object in a small file. The plan shows it if nobody can tell it from the "
      "source at that height, or if it looks better than any scale in the time or the bytes. On a slow link "
      "a larger proxy may come before a scale.\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when not even the least fits the budget.");
}

void add_check_command(Command& app) {
  auto [c, args] =
      app.add("check", "Fail when a package does not show well enough in a time: a gate for CI", run_check);
  add_delivery_options(c, args);
  c.option(
       "--max-flip", args.gate.max_flip,
       "Largest FLIP of the lit object, 0 = equal to the source. It limits the predicted FLIP of the plan, "
       "and the rendered FLIP of each scale beside S_0 at its switch size, in the worst view")
      .number_in(0, 1);
  c.flag("--predicted-only", args.predicted_only,
         "--max-flip goes by the plan alone: nothing is rendered, and little of the package is read");
  c.option("--views", args.views, "Directions from which switch sizes are rendered")
      .integer_in(1, 64)
      .shows_default();
  c.option("--max-texture-flip", args.gate.max_texture_flip,
           "Largest predicted FLIP by the textures alone, on the finest scale")
      .number_in(0, 1);
  c.option("--max-first-picture", args.gate.max_first_picture_s, parse_duration,
           "Latest time of the first picture: 1s, 800ms", "TIME");
  c.option("--max-bytes", args.gate.max_bytes, parse_bytes, "Most bytes in all: 500kB", "SIZE");
  c.option("--junit", args.junit, "Write a test case for every limit as JUnit XML", "FILE");
  c.flag("--json", args.json, "Print one JSON object (schemas/plan.v1.schema.json)");
  c.examples(
      "  texmesh check bust.texmesh --time 3 --bandwidth 2Mbit/s --max-flip 0.08 --max-first-picture 1s\n"
      "  texmesh check bust.texmesh --time 3 --bandwidth 2Mbit/s --max-flip 0.05 --junit check.xml");
  c.notes(
      "texmesh report shows the pictures behind the rendered FLIP.\n"
      "Exit code: 0 good enough, 4 not good enough, 1 when the package cannot be read, 2 usage.");
}

void add_simulate_command(Command& app) {
  auto [c, args] = app.add("simulate", "Play a transfer over a model of a network", run_simulate);
  add_delivery_options(c, args);
  c.option("--plot", args.plot, "Write an SVG: quality and time by fragment, throughput, credit", "FILE");
  c.flag("--json", args.json, "Print one JSON object (schemas/simulate.v1.schema.json)");
  c.examples(
      "  texmesh simulate bust.texmesh --time 5 --bandwidth 2Mbit/s --rtt 50\n"
      "  texmesh simulate bust.texmesh --time 5 --trace monday.csv --plot monday.svg\n"
      "  texmesh simulate bust.texmesh --bandwidth 2Mbit/s --mirror 1Mbit/s --mirror 500kbit/s");
  c.notes(
      "The deviation is a share of the time limit. It is positive when the transfer ended early.\n"
      "Exit code: 0, 1 when the package or the trace cannot be read, 2 usage.");
}

}  // namespace texmesh
