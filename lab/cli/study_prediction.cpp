// texmesh-lab study prediction: what plans are predicted to look like, beside what they look like.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "format/base/json_fields.h"
#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"
#include "lab/cli/commands.h"
#include "lab/cli/plan_pictures.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"

namespace texmesh {
namespace {

/// How a plan came about.
/// - kBudget: scale and height are drawn, and the bytes that `plan --budget` spends.
/// - kLink: a link, a round trip and a time limit are drawn; scale and rungs are what a client chooses.
/// - kMix: nobody's choice: scale, mips of each group and the rung of every fragment are drawn.
enum class DrawnKind : std::uint8_t { kBudget, kLink, kMix };
struct DrawnPlan {
  DrawnKind kind = DrawnKind::kBudget;
  DeliveryRequest request;
  DeliveryPlan plan;
};

constexpr double kLeastDrawnBytes = 50e3, kMostDrawnBytes = 8e6;
constexpr std::array<double, 5> kHeights{256, 362, 512, 724, 1024};

/// Even in the logarithm.
double log_between(SplitMix& random, double low, double high) {
  return low * portable::exp(random.next() * portable::log(high / low));
}

double all_bytes(PackageReader& package) {
  double all = kLeastDrawnBytes;
  for (const EntryRef& e : package.entries()) all += static_cast<double>(e.bytes);
  return std::min(all, kMostDrawnBytes);
}

/// A choice of scale and rungs, with what is predicted of it.
DeliveryPlan plan_of(PackageReader& package, const DeliveryRequest& request, int scale,
                     const std::vector<PlaneChoice>& planes, const std::vector<std::int32_t>& rungs) {
  DeliveryPlan plan;
  plan.scale = scale;
  plan.planes = planes;
  plan.textures.rungs = rungs;
  const FragmentList list = list_of(package, request, plan);
  for (std::size_t i = 0; i < rungs.size(); ++i)
    if (rungs[i] >= 0) plan.texture_bytes += list.offers[i].bytes[static_cast<std::size_t>(rungs[i])];
  const PerGroup losses = losses_of(list, rungs);
  plan.texture_flip = texture_flip(package.quality(), losses);
  plan.flip = picture_flip(package.quality(), request.displayed_px, scale, losses);
  return plan;
}

DeliveryPlan drawn_link(PackageReader& package, SplitMix& random, DeliveryRequest& request) {
  request.network.link = BandwidthTrace::constant(log_between(random, 20e3, 2e6));
  request.network.rtt_s = log_between(random, 0.01, 0.2);
  request.time_limit_s = log_between(random, 2, 20);
  return plan_delivery(package, request);
}

DeliveryPlan drawn_mix(PackageReader& package, SplitMix& random, DeliveryRequest& request) {
  std::array<int, kPlaneGroups> levels{};
  for (int& level : levels) level = static_cast<int>(random.below(3));
  const std::vector<PlaneChoice> planes = planes_for_display(package, request.displayed_px, levels);
  ListOptions options;
  options.scale = request.scale;
  options.displayed_px = request.displayed_px;
  std::vector<std::int32_t> rungs;
  for (const FragmentOffer& f : fragment_list(package, planes, options).offers)
    rungs.push_back(static_cast<std::int32_t>(random.below(f.bytes.size() + 1)) - 1);
  return plan_of(package, request, request.scale, planes, rungs);
}

std::string drawn_kind_name(DrawnKind kind) {
  return kind == DrawnKind::kBudget ? "budget" : kind == DrawnKind::kLink ? "link" : "mix";
}

/// `count` plans of the package, the kinds in turn, by rising displayed height (256 to 1024 px). The same for
/// the same seed on every machine.
std::vector<DrawnPlan> draw_plans(PackageReader& package, int count, std::uint64_t seed) {
  SplitMix random(seed);
  const double most_bytes = all_bytes(package);
  const std::vector<ManifestScale>& scales = package.manifest().scales;
  std::vector<DrawnPlan> out;
  for (int i = 0; i < count; ++i) {
    DrawnPlan drawn{static_cast<DrawnKind>(i % 3), {}, {}};
    DeliveryRequest& request = drawn.request;
    request.displayed_px = kHeights[random.below(kHeights.size())];
    if (drawn.kind == DrawnKind::kLink) {
      drawn.plan = drawn_link(package, random, request);
    } else {
      request.scale = scales[random.below(scales.size())].scale;
      drawn.plan =
          drawn.kind == DrawnKind::kMix
              ? drawn_mix(package, random, request)
              : plan_budget(package, request,
                            static_cast<std::uint64_t>(log_between(random, kLeastDrawnBytes, most_bytes)));
    }
    out.push_back(std::move(drawn));
  }
  // Pictures of the source are shared by plans of one height.
  std::ranges::stable_sort(out, {}, [](const DrawnPlan& p) { return p.request.displayed_px; });
  return out;
}

using Json = nlohmann::ordered_json;

struct PredictionArguments {
  std::vector<std::string> packages;
  std::string against;
  std::vector<std::string> budgets;
  int plans = 20, views = 4, jobs = 0;
  double display_px = 512;
  std::uint64_t seed = 1;
  bool json = false;
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

std::vector<Row> rows_of(const PredictionArguments& args, const std::string& path) {
  PackageReader package(open_store(path));
  PlanPictures pictures(package, args.against, args.views, context_of(args.jobs));
  std::vector<Row> rows;
  for (const std::string& budget : args.budgets) {
    DrawnPlan given{DrawnKind::kBudget, {}, {}};
    given.request.displayed_px = args.display_px;
    given.plan = plan_budget(package, given.request, parse_bytes(budget, "--budget"));
    rows.push_back(measured(package, pictures, given, "budget"));
  }
  if (rows.empty())
    for (const DrawnPlan& drawn : draw_plans(package, args.plans, args.seed))
      rows.push_back(measured(package, pictures, drawn, drawn_kind_name(drawn.kind)));
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

Table prediction_table(const std::vector<Row>& rows) {
  Table table{"",
              {Column::text("package", "package"),
               Column::text("kind", "kind"),
               {"px", 0, "displayed_px"},
               {"S", 0, "scale"},
               Column::data("proxy"),
               {"bytes", kGrouped, "bytes"},
               {"predicted", 4, "predicted"},
               {"scale", 4, "predicted_geometry"},
               {"textures", 4, "predicted_textures"},
               {"rendered", 4, "rendered"},
               {"scale", 4, "rendered_geometry"},
               {"textures", 4, "rendered_textures"},
               {"error %", percent_form(), "error"}}};
  for (const Row& r : rows)
    table.row({r.package, r.kind, r.displayed_px,
               r.proxy ? Cell(r.scale, fmt::format("proxy {}", *r.proxy)) : Cell(r.scale), r.proxy, r.bytes,
               r.predicted, r.predicted_geometry, r.predicted_textures, r.rendered.whole, r.rendered.geometry,
               r.rendered.textures, r.error()});
  return table;
}

int run_prediction(const PredictionArguments& args) {
  if (!args.against.empty() && args.packages.size() > 1)
    throw UsageError("study prediction: --against", "", "one package", std::to_string(args.packages.size()));
  std::vector<Row> rows;
  for (const std::string& path : args.packages)
    for (Row& row : rows_of(args, path)) rows.push_back(std::move(row));
  const Table table = prediction_table(rows);
  double error = 0;
  for (const Row& r : rows) error += r.error() / static_cast<double>(rows.size());
  const double correlation = rank_correlation(rows);
  if (args.json)
    std::cout
        << Json{{"plans", table.json()}, {"mean_error", error}, {"rank_correlation", correlation}}.dump()
        << '\n';
  else
    std::cout << table.text()
              << fmt::format("{} plans: mean error {:.1f} %, rank correlation {:.3f}\n", rows.size(),
                             100 * error, correlation);
  return kExitOk;
}

}  // namespace

void add_prediction_study(Command& study) {
  auto [c, args] = study.add(
      "prediction", "Does a plan look as quality.json predicts? FLIP of plans, rendered", run_prediction);
  c.option("PKG", args.packages, "Packages").required();
  c.option("--plans", args.plans,
           "Random plans of each, in turn: for bytes, for a link and a time, of drawn mips")
      .integer_in(1, 10000)
      .shows_default();
  c.option("--seed", args.seed, "Seed of the plans").shows_default();
  c.option("--budget", args.budgets,
           "What plan --budget chooses, instead of random plans; may be given again", "SIZE");
  c.option("--display", args.display_px, "Displayed height with --budget, px")
      .number_in(16, 2048)
      .shows_default();
  c.option("--against", args.against,
           "Its model file, for the source's texels; else the best rungs stand for them", "MODEL");
  c.option("--views", args.views, "Directions that are rendered").integer_in(1, 64).shows_default();
  add_jobs_and_json_options(c, args.jobs, args.json);
  c.examples(
      "  texmesh-lab study prediction turtle.texmesh --against turtle.glb --plans 20 --seed 7\n"
      "  texmesh-lab study prediction turtle.texmesh --against turtle.glb --budget 200kB --budget 1MB");
  c.notes(
      "FLIP is of lit pictures against S_0 with the source's texels, 0 = equal: of the plan, of its scale "
      "with the source's texels, of S_0 with its textures. Of a rebuilt atlas it is against the model itself.\n"
      "Exit code: 0, 1 when a file cannot be read, 2 usage.");
}

}  // namespace texmesh
