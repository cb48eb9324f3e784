// texmesh-lab study prediction: what plans are predicted to look like, beside what they look like.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <fstream>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "lab/cli/studies/plan_pictures.h"
#include "lab/cli/studies/random_plans.h"
#include "lab/cli/studies/studies.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/units.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

struct PredictionArguments {
  std::vector<std::string> packages;
  std::string against, plan;
  std::vector<std::string> budgets;
  int plans = 20, views = 4, jobs = 0;
  double display_px = 512;
  std::uint64_t seed = 1;
  bool every_scale = false, json = false;
};

/// A plan, and what it looks like.
struct Row {
  std::string package, kind;
  double displayed_px = 0;
  int scale = 0;
  std::optional<std::uint32_t> proxy;  // instead of a scale
  std::uint64_t bytes = 0;
  double predicted = 0, predicted_geometry = 0, predicted_textures = 0;
  RenderedFlip rendered;
  double error() const {
    return rendered.whole > 0 ? std::abs(predicted - rendered.whole) / rendered.whole : 0;
  }
};

Row measured(PackageReader& package, PlanPictures& pictures, const DrawnPlan& drawn, std::string kind) {
  const DeliveryPlan& plan = drawn.plan;
  const double px = drawn.request.displayed_px;
  Row row{package.store().name(), std::move(kind), px, plan.scale,        plan.proxy,
          plan.bytes(),           plan.flip,       0,  plan.texture_flip, {}};
  if (!plan.proxy) row.predicted_geometry = picture_flip(package.quality(), px, plan.scale, {});
  row.rendered = pictures.measure(shown_by(package, plan, list_of(package, drawn.request, plan)), px);
  return row;
}

/// What `texmesh plan --json` printed, of this package or of one with the same planes.
ShownPackage read_plan(const std::string& path, PackageReader& package) {
  std::ifstream in(path, std::ios::binary);
  const Json j = Json::parse(in, nullptr, false);
  if (j.is_discarded() || !j.contains("planes")) throw InputError(path, "", "output of plan --json", "other");
  ShownPackage shown{j.at("scale").get<int>(), {}, {}};
  if (j.contains("proxy")) shown.proxy = j.at("proxy").get<std::uint32_t>();
  for (const Json& p : j.at("planes")) {
    ShownPlane plane{{p.at("texture").get<std::uint32_t>(), p.at("plane").get<std::uint32_t>()}, {}};
    for (const Json& rung : p.at("rungs"))
      plane.rungs.push_back(rung.is_null() ? -1 : rung.get<std::int32_t>());
    if (plane.choice.plane >= package.tables().planes.size())
      throw InputError(path, "/planes", "planes of the package", std::to_string(plane.choice.plane));
    shown.planes.push_back(std::move(plane));
  }
  return shown;
}

std::vector<int> scales_of(PackageReader& package) {
  std::vector<int> numbers;
  for (const ManifestScale& s : package.manifest().scales) numbers.push_back(s.scale);
  return numbers;
}

std::vector<Row> rows_of(const PredictionArguments& args, const std::string& path) {
  PackageReader package(open_store(path));
  PlanPictures pictures(package, args.against, args.views, context_of(args.jobs));
  std::vector<Row> rows;
  if (!args.plan.empty()) {
    const ShownPackage shown = read_plan(args.plan, package);
    rows.push_back({path, "plan", args.display_px, shown.scale, shown.proxy, 0, 0, 0, 0,
                    pictures.measure(shown, args.display_px)});
    return rows;
  }
  for (const std::string& budget : args.budgets)
    for (const int scale : args.every_scale ? scales_of(package) : std::vector<int>{-1}) {
      DrawnPlan given{DrawnKind::kBudget, {}, {}};
      given.request.displayed_px = args.display_px;
      given.request.scale = scale;
      given.plan = plan_budget(package, given.request, parse_bytes(budget, "--budget"));
      rows.push_back(measured(package, pictures, given, "budget"));
    }
  if (rows.empty())
    for (const DrawnPlan& drawn : draw_plans(package, args.plans, args.seed))
      rows.push_back(measured(package, pictures, drawn, name_of(drawn.kind)));
  return rows;
}

/// Places of values in their rising order; equal ones share the mean of theirs.
std::vector<double> ranks(const std::vector<double>& values) {
  std::vector<std::size_t> order(values.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return values[i]; });
  std::vector<double> out(values.size());
  for (std::size_t i = 0, end = 0; i < order.size(); i = end) {
    while (end < order.size() && values[order[end]] == values[order[i]]) ++end;
    for (std::size_t k = i; k < end; ++k) out[order[k]] = static_cast<double>(i + end - 1) / 2;
  }
  return out;
}

/// Spearman's rank correlation; 0 where either side is constant.
double rank_correlation(const std::vector<Row>& rows) {
  std::vector<double> a, b;
  for (const Row& r : rows) {
    a.push_back(r.predicted);
    b.push_back(r.rendered.whole);
  }
  a = ranks(a), b = ranks(b);
  const double mean = (static_cast<double>(rows.size()) - 1) / 2;
  double ab = 0, aa = 0, bb = 0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    ab += (a[i] - mean) * (b[i] - mean);
    aa += (a[i] - mean) * (a[i] - mean);
    bb += (b[i] - mean) * (b[i] - mean);
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

double mean_error(const std::vector<Row>& rows) {
  double sum = 0;
  for (const Row& r : rows) sum += r.error();
  return rows.empty() ? 0 : sum / static_cast<double>(rows.size());
}

Json prediction_json(const std::vector<Row>& rows) {
  Json list = Json::array();
  for (const Row& r : rows) {
    list.push_back({{"package", r.package},
                    {"kind", r.kind},
                    {"displayed_px", r.displayed_px},
                    {"scale", r.scale},
                    {"bytes", r.bytes},
                    {"predicted", r.predicted},
                    {"predicted_geometry", r.predicted_geometry},
                    {"predicted_textures", r.predicted_textures},
                    {"rendered", r.rendered.whole},
                    {"rendered_geometry", r.rendered.geometry},
                    {"rendered_textures", r.rendered.textures},
                    {"error", r.error()}});
    if (r.proxy) list.back()["proxy"] = *r.proxy;
  }
  return {{"plans", list}, {"mean_error", mean_error(rows)}, {"rank_correlation", rank_correlation(rows)}};
}

std::string prediction_text(const std::vector<Row>& rows) {
  Table table;
  table.column("package", Align::kLeft);
  table.column("kind", Align::kLeft);
  for (const char* header :
       {"px", "S", "bytes", "predicted", "scale", "textures", "rendered", "scale", "textures", "error %"})
    table.column(header);
  for (const Row& r : rows)
    table.row({r.package, r.kind, fixed(r.displayed_px, 0),
               r.proxy ? fmt::format("proxy {}", *r.proxy) : std::to_string(r.scale), grouped(r.bytes),
               fixed(r.predicted, 4), fixed(r.predicted_geometry, 4), fixed(r.predicted_textures, 4),
               fixed(r.rendered.whole, 4), fixed(r.rendered.geometry, 4), fixed(r.rendered.textures, 4),
               fixed(100 * r.error(), 1)});
  return table.text() + fmt::format("{} plans: mean error {:.1f} %, rank correlation {:.3f}\n", rows.size(),
                                    100 * mean_error(rows), rank_correlation(rows));
}

int run_prediction(const PredictionArguments& args) {
  if (!args.against.empty() && args.packages.size() > 1)
    throw UsageError("study prediction: --against", "", "one package", std::to_string(args.packages.size()));
  std::vector<Row> rows;
  for (const std::string& path : args.packages)
    for (Row& row : rows_of(args, path)) rows.push_back(std::move(row));
  std::cout << (args.json ? prediction_json(rows).dump() + "\n" : prediction_text(rows));
  return kExitOk;
}

}  // namespace

void add_prediction_study(Command& study) {
  auto args = std::make_shared<PredictionArguments>();
  Command c = study.add("prediction", "Does a plan look as quality.json predicts? FLIP of plans, rendered");
  c.option("PKG", args->packages, "Packages").required();
  c.option(
       "--plans", args->plans,
       "Random plans per package, in turn: what clients choose for a number of bytes, for a link and a time, "
       "and drawn mips and rungs")
      .integer_in(1, 10000)
      .shows_default();
  c.option("--seed", args->seed, "Seed of the plans").shows_default();
  c.option("--budget", args->budgets,
           "What plan --budget chooses, instead of random plans; may be given again")
      .value_name("SIZE");
  c.flag("--every-scale", args->every_scale,
         "With --budget: the best of every scale, not only of the best one");
  c.option("--plan", args->plan, "What plan --json printed, instead of random plans").value_name("FILE");
  c.option("--display", args->display_px, "Displayed height with --budget and --plan, px")
      .number_in(16, 2048)
      .shows_default();
  c.option(
       "--against", args->against,
       "The model file that the package was made from, for the source's texels; without it the best rungs "
       "stand for them")
      .value_name("MODEL");
  c.option("--views", args->views, "Directions that are rendered").integer_in(1, 64).shows_default();
  add_jobs_option(c, args->jobs);
  c.flag("--json", args->json, "Print one JSON object");
  c.examples(
      "  texmesh-lab study prediction turtle.texmesh --against turtle.glb --plans 20 --seed 7\n"
      "  texmesh-lab study prediction turtle.texmesh --against turtle.glb --budget 200kB --budget 1MB");
  c.notes(
      "FLIP is of lit pictures against S_0 with the source's texels, 0 = equal: of the plan, of its scale "
      "with the source's texels, of S_0 with its textures.\n"
      "Exit code: 0, 1 when a file cannot be read, 2 usage.");
  c.on_run([args] { return run_prediction(*args); });
}

}  // namespace texmesh
