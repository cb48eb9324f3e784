#include <fmt/format.h>
#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/delivery_options.h"
#include "pipeline/cli/units.h"
#include "pipeline/inspect/text_table.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

Json plan_json(const DeliveryPlan& p) {
  Json rungs = Json::array();
  for (const std::int32_t r : p.textures.rungs) rungs.push_back(r);
  Json planes = Json::array();
  for (const PlaneChoice& c : p.planes) planes.push_back({{"texture", c.base}, {"plane", c.plane}});
  return {{"version", 1},
          {"scale", p.scale},
          {"planes", planes},
          {"first_picture_s", p.first_picture_s},
          {"mesh_s", p.mesh_s},
          {"complete_s", p.complete_s},
          {"bytes",
           {{"bootstrap", p.bootstrap_bytes},
            {"first_picture", p.first_picture_bytes},
            {"mesh", p.mesh_bytes},
            {"tables", p.table_bytes},
            {"texture", p.texture_bytes},
            {"all", p.bytes()}}},
          {"fragments", p.textures.rungs.size()},
          {"skipped", p.textures.skipped},
          {"mean_quality", p.mean_quality},
          {"worst_quality", p.worst_quality},
          {"texture_ssim", 1 - p.texture_dssim},
          {"ssim", p.ssim},
          {"warnings", p.warnings}};
}

std::string textures_text(const DeliveryPlan& p) {
  std::string text;
  if (!p.textures.rungs.empty())
    text += fmt::format("fragments: {}, {} skipped; quality {:.0f} in the mean, {:.0f} at worst\n",
                        p.textures.rungs.size(), p.textures.skipped, p.mean_quality, p.worst_quality);
  for (const std::string& w : p.warnings) text += "warning: " + w + "\n";
  return text;
}

std::string plan_text(const DeliveryPlan& p) {
  std::string text = fmt::format(
      "S_{}, predicted SSIM {:.3f} of the rendered object, {:.3f} of its textures\n"
      "first picture at {:.2f} s ({} bytes), mesh complete at {:.2f} s, textures at {:.2f} s\n"
      "bytes: {} start, {} first picture, {} mesh, {} tables, {} textures; {} in all\n",
      p.scale, p.ssim, 1 - p.texture_dssim, p.first_picture_s,
      grouped(p.bootstrap_bytes + p.first_picture_bytes), p.mesh_s, p.complete_s, grouped(p.bootstrap_bytes),
      grouped(p.first_picture_bytes), grouped(p.mesh_bytes), grouped(p.table_bytes), grouped(p.texture_bytes),
      grouped(p.bytes()));
  return text + textures_text(p);
}

std::string budget_text(const DeliveryPlan& p) {
  return fmt::format(
             "S_{}, predicted SSIM {:.3f} of the rendered object, {:.3f} of its textures\n"
             "bytes: {} start, {} first picture, {} mesh, {} tables, {} textures; {} in all\n",
             p.scale, p.ssim, 1 - p.texture_dssim, grouped(p.bootstrap_bytes), grouped(p.first_picture_bytes),
             grouped(p.mesh_bytes), grouped(p.table_bytes), grouped(p.texture_bytes), grouped(p.bytes())) +
         textures_text(p);
}

struct PlanArguments : DeliveryArguments {
  std::string budget;
};

struct CheckArguments : DeliveryArguments {
  double min_ssim = 0, min_texture_ssim = 0;
  std::string max_first_picture, max_bytes;
};

}  // namespace

void add_plan_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<PlanArguments>();
  CLI::App* c =
      app.add_subcommand("plan", "Say what a viewer will get in a time over a link, or in a number of bytes");
  add_delivery_options(*c, *args, true);
  c->add_option("--budget", args->budget,
                "Bytes instead of time: the mesh and the textures that look best together in 500kB");
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "Plays the transfer over a model of the network; the package alone decides. The predicted SSIM comes "
      "from what\n"
      "compile measured.\n"
      "Examples:\n"
      "  texmesh plan bust.texmesh --display 800 --time 3 --bandwidth 2Mbit/s --rtt 40\n"
      "  texmesh plan https://host/bust.texmesh --display 400 --time 1.5 --trace monday.csv --rtt 80\n"
      "  texmesh plan bust.texmesh --display 800 --budget 500kB\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage, 4 when not even the least fits the budget.");
  c->callback([args, &exit_code] {
    const bool budget = !args->budget.empty();
    args->needs_link = !budget;
    const DeliveryRequest request = delivery_request(*args);
    PackageReader package(open_store(args->package));
    if (!budget) {
      const DeliveryPlan plan = plan_delivery(package, request);
      std::cout << (args->json ? plan_json(plan).dump() + "\n" : plan_text(plan));
      exit_code = kExitOk;
      return;
    }
    const std::uint64_t bytes = parse_bytes(args->budget, "--budget");
    const DeliveryPlan plan = plan_budget(package, request, bytes);
    Json j = plan_json(plan);
    for (const char* timed : {"first_picture_s", "mesh_s", "complete_s"}) j.erase(timed);
    std::cout << (args->json ? j.dump() + "\n" : budget_text(plan));
    exit_code = plan.bytes() <= bytes ? kExitOk : kExitDifferent;
  });
}

void add_check_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<CheckArguments>();
  CLI::App* c =
      app.add_subcommand("check", "Fail when a package does not show well enough in a time: a gate for CI");
  add_delivery_options(*c, *args, true);
  c->add_option("--min-ssim", args->min_ssim, "Least predicted SSIM of the rendered object")
      ->check(CLI::Range(0.0, 1.0));
  c->add_option("--min-texture-ssim", args->min_texture_ssim, "Least surface-weighted SSIM of the textures")
      ->check(CLI::Range(0.0, 1.0));
  c->add_option("--max-first-picture", args->max_first_picture,
                "Latest time of the first picture: 1s, 800ms");
  c->add_option("--max-bytes", args->max_bytes, "Most bytes in all: 500kB");
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "Example:\n"
      "  texmesh check bust.texmesh --display 800 --time 3 --bandwidth 2Mbit/s --min-ssim 0.95 "
      "--max-first-picture 1s\n"
      "Exit code: 0 good enough, 4 not, 1 when the package cannot be read, 2 usage.");
  c->callback([args, &exit_code] {
    const DeliveryRequest request = delivery_request(*args);
    const double first_s = args->max_first_picture.empty()
                               ? 1e300
                               : parse_duration(args->max_first_picture, "--max-first-picture");
    PackageReader package(open_store(args->package));
    const DeliveryPlan plan = plan_delivery(package, request);
    std::vector<std::string> reasons;
    if (plan.ssim < args->min_ssim)
      reasons.push_back(
          fmt::format("predicted SSIM {:.4f}, expected at least {:.4f}", plan.ssim, args->min_ssim));
    if (1 - plan.texture_dssim < args->min_texture_ssim)
      reasons.push_back(fmt::format("SSIM of the textures {:.4f}, expected at least {:.4f}",
                                    1 - plan.texture_dssim, args->min_texture_ssim));
    if (plan.first_picture_s > first_s)
      reasons.push_back(
          fmt::format("first picture at {:.2f} s, expected by {:.2f} s", plan.first_picture_s, first_s));
    if (plan.complete_s > 1.01 * request.time_limit_s)
      reasons.push_back(
          fmt::format("complete at {:.2f} s, expected by {:.2f} s", plan.complete_s, request.time_limit_s));
    if (!args->max_bytes.empty() && plan.bytes() > parse_bytes(args->max_bytes, "--max-bytes"))
      reasons.push_back(fmt::format("{} bytes, expected at most {}", grouped(plan.bytes()), args->max_bytes));
    if (args->json) {
      Json j = plan_json(plan);
      j["good"] = reasons.empty();
      j["reasons"] = reasons;
      std::cout << j.dump() << '\n';
    } else {
      std::cout << plan_text(plan);
      for (const std::string& r : reasons) std::cout << "not good enough: " << r << '\n';
      if (reasons.empty()) std::cout << "good enough\n";
    }
    exit_code = reasons.empty() ? kExitOk : kExitDifferent;
  });
}

}  // namespace texmesh
