#include <fmt/format.h>
#include <iostream>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "format/container/layout.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/table.h"
#include "tools/cli/check/check_gate.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/cli/options/delivery_text.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// By plane: the rung of each fragment, row by row; -1 skipped, null where nothing is stored.
Json planes_json(PackageReader& package, const DeliveryPlan& p, const FragmentList& list) {
  Json planes = Json::array();
  for (const PlaneChoice& c : p.planes) {
    const PlaneTables& t = package.tables().planes[c.plane];
    Json rungs(std::vector<Json>(t.fragment_count()));
    for (std::size_t i = 0; i < list.fragments.size(); ++i)
      if (list.fragments[i].plane == c.plane) rungs[list.fragments[i].fragment] = p.textures.rungs[i];
    planes.push_back(
        {{"texture", c.base}, {"plane", c.plane}, {"rung_quality", t.rung_quality}, {"rungs", rungs}});
  }
  return planes;
}

Json plan_json(PackageReader& package, const DeliveryPlan& p, const FragmentList& list) {
  Json j{{"version", 1},
         {"scale", p.scale},
         {"planes", planes_json(package, p, list)},
         {"first_picture_s", p.first_picture_s},
         {"mesh_s", p.mesh_s},
         {"complete_s", p.complete_s},
         {"bytes",
          {{"bootstrap", p.bootstrap_bytes},
           {"first_picture", p.first_picture_bytes},
           {"step", p.step_bytes},
           {"mesh", p.mesh_bytes},
           {"tables", p.table_bytes},
           {"texture", p.texture_bytes},
           {"all", p.bytes()}}},
         {"gpu_bytes", gpu_json(p.gpu)},
         {"fragments", p.textures.rungs.size()},
         {"skipped", p.textures.skipped},
         {"mean_quality", p.mean_quality},
         {"worst_quality", p.worst_quality},
         {"texture_flip", p.texture_flip},
         {"flip", p.flip},
         {"warnings", p.warnings}};
  if (p.proxy) j["proxy"] = *p.proxy;
  if (p.step) j["step"] = {{"proxy", *p.step}, {"at_s", p.step_s}};
  return j;
}

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
  for (const std::string& w : p.warnings) text += "warning: " + w + "\n";
  return text;
}

/// `timed`: of a plan over a link, not of a budget.
std::string plan_text(PackageReader& package, const DeliveryPlan& p, const FragmentList& list, bool timed) {
  std::string text =
      fmt::format("{}, predicted FLIP {:.4f} (0 = equal to the source), {:.4f} by the textures alone\n",
                  shown_text(p), p.flip, p.texture_flip);
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
    Json j = plan_json(package, plan, list);
    if (args.budget)
      for (const char* timed : {"first_picture_s", "mesh_s", "complete_s"}) j.erase(timed);
    std::cout << j.dump() << '\n';
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
    const auto sizes = check_switch_sizes(package, args.gate.max_flip, args.views, context_of(0));
    results.insert(results.end(), sizes.begin(), sizes.end());
  }
  if (!args.junit.empty()) write_gate_junit(args.junit, "texmesh check", args.package, results);
  const std::vector<std::string> reasons = gate_failures(results);
  if (args.json) {
    Json j = plan_json(package, plan, list);
    j["good"] = reasons.empty();
    j["reasons"] = reasons;
    std::cout << j.dump() << '\n';
  } else {
    std::cout << plan_text(package, plan, list, true);
    for (const std::string& r : reasons) std::cout << "not good enough: " << r << '\n';
    if (reasons.empty()) std::cout << "good enough\n";
  }
  return reasons.empty() ? kExitOk : kExitDifferent;
}

}  // namespace

void add_plan_command(Command& app) {
  auto args = std::make_shared<PlanArguments>();
  Command c = app.add("plan", "Say what a viewer will get in a time over a link, or in a number of bytes");
  add_delivery_options(c, *args);
  c.option(
       "--budget", [a = args.get()](const std::string& text) { a->budget = parse_bytes(text, "--budget"); },
       "Bytes instead of time: the mesh and the textures that look best together in 500kB")
      .value_name("SIZE");
  c.flag("--json", args->json, "Print one JSON object (schemas/plan.v1.schema.json)");
  c.examples(
      "  texmesh plan bust.texmesh --display 800 --time 3 --bandwidth 2Mbit/s --rtt 40\n"
      "  texmesh plan https://host/bust.texmesh --display 400 --time 1.5 --trace monday.csv --rtt 80\n"
      "  texmesh plan bust.texmesh --display 800 --budget 500kB\n"
      "  texmesh plan bust.texmesh --display 2000 --time 5 --bandwidth 20Mbit/s --memory 64MB");
  c.notes(
      "plan plays the transfer over a model of the network and needs nothing but the package. FLIP is "
      "how much a lit picture of that height differs from one of the source, in the mean over the object: 0 "
      "= equal, 1 = as different as can be. It comes from the table that compile measured.\n"
      "A proxy is a small file with an atlas of its own. The plan shows it if nobody can tell it from the "
      "source at that height, or if it looks better than any scale in the time or the bytes. On a slow link "
      "a larger proxy may come before a scale.\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when not even the least fits the budget.");
  c.on_run([args] { return run_plan(*args); });
}

void add_check_command(Command& app) {
  auto args = std::make_shared<CheckArguments>();
  Command c = app.add("check", "Fail when a package does not show well enough in a time: a gate for CI");
  add_delivery_options(c, *args);
  c.option(
       "--max-flip", args->gate.max_flip,
       "Largest FLIP of the lit object, 0 = equal to the source. It limits the predicted FLIP of the plan, "
       "and the rendered FLIP of each scale beside S_0 at its switch size, in the worst view")
      .number_in(0, 1);
  c.flag("--predicted-only", args->predicted_only,
         "--max-flip goes by the plan alone: nothing is rendered, and little of the package is read");
  c.option("--views", args->views, "Directions from which switch sizes are rendered")
      .integer_in(1, 64)
      .shows_default();
  c.option("--max-texture-flip", args->gate.max_texture_flip,
           "Largest predicted FLIP by the textures alone, on the finest scale")
      .number_in(0, 1);
  c.option(
       "--max-first-picture",
       [a = args.get()](const std::string& text) {
         a->gate.max_first_picture_s = parse_duration(text, "--max-first-picture");
       },
       "Latest time of the first picture: 1s, 800ms")
      .value_name("TIME");
  c.option(
       "--max-bytes",
       [a = args.get()](const std::string& text) { a->gate.max_bytes = parse_bytes(text, "--max-bytes"); },
       "Most bytes in all: 500kB")
      .value_name("SIZE");
  c.option("--junit", args->junit, "Write a test case for every limit as JUnit XML").value_name("FILE");
  c.flag("--json", args->json, "Print one JSON object (schemas/plan.v1.schema.json)");
  c.examples(
      "  texmesh check bust.texmesh --time 3 --bandwidth 2Mbit/s --max-flip 0.08 --max-first-picture 1s\n"
      "  texmesh check bust.texmesh --time 3 --bandwidth 2Mbit/s --max-flip 0.05 --junit check.xml");
  c.notes(
      "texmesh report shows the pictures behind the rendered FLIP.\n"
      "Exit code: 0 good enough, 4 not good enough, 1 when the package cannot be read, 2 usage.");
  c.on_run([args] { return run_check(*args); });
}

}  // namespace texmesh
