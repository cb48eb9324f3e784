// texmesh-lab study method: the thesis as printed beside what texmesh does by default, on one model.
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include "lab/cli/commands.h"
#include "lab/cli/plan_pictures.h"
#include "lab/transfer/chapter_4.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/compile/options.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/new_folder.h"
#include "pipeline/io/table.h"
#include "tools/cli/options/common_options.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/inspect/package_mesh.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
namespace fs = std::filesystem;

constexpr int kBurstyRuns = 10;
constexpr double kBurstVariation = 0.5, kBurstCorrelation = 0.9, kBurstStep_s = 0.1;

struct MethodArguments {
  std::string input, thesis, against;
  DeliveryArguments delivery;  // time limit and link
  std::vector<int> displays_px{150, 300, 600, 1000};
  int views = 4, jobs = 0;
  CacheChoice cache;
  bool json = false;
};

/// One system: a package, and how a client reads it.
struct System {
  std::string package;
  bool printed = false;
};

/// What a system shows at one displayed height.
struct MethodRow {
  double displayed_px = 0;
  int scale = 0;
  std::optional<std::uint32_t> proxy;
  std::uint32_t triangles = 0;
  std::uint64_t bytes = 0, texture_bytes = 0;
  double predicted_flip = 0;
  RenderedFlip rendered;
  double end_s = 0;            // over the link at its mean
  double bursty_late_s = 0;    // over bursty links, mean of the runs: how late
  double bursty_missed_s = 0;  // how far from the limit, either way
};

struct SystemFigures {
  std::string name;
  std::uint64_t package_bytes = 0;
  std::vector<int> scales;
  std::vector<ManifestStep> steps;  // by the system's rule
  std::vector<MethodRow> rows;
};

std::string compiled(const MethodArguments& args, const fs::path& folder, const std::string& profile) {
  CompileRequest request;
  request.input = args.input;
  request.output = (folder / ((profile.empty() ? "texmesh" : profile) + ".texmesh")).string();
  apply_profile(profile, request.options);
  compile_model(request, *store_of(args.cache), context_of(args.jobs), {});
  return request.output;
}

/// What `plan` asks with these options, and with --policy thesis where the system is the printed one.
DeliveryRequest method_request(const MethodArguments& args, const System& system, double displayed_px) {
  DeliveryArguments delivery = args.delivery;
  delivery.request.displayed_px = displayed_px;
  if (system.printed) delivery.request.htc.policy = Policy::kThesis;
  return delivery_request(delivery);
}

void play_bursts(PackageReader& package, DeliveryRequest request, double mean_bytes_s, MethodRow& row) {
  request.beta0_bytes_s = mean_bytes_s;  // a historic average
  for (int run = 0; run < kBurstyRuns; ++run) {
    request.network.link = random_trace(mean_bytes_s, kBurstVariation, kBurstCorrelation, kBurstStep_s,
                                        4 * request.time_limit_s, static_cast<std::uint64_t>(run) + 1);
    const double off_s = plan_delivery(package, request).complete_s - request.time_limit_s;
    row.bursty_late_s += std::max(0.0, off_s) / kBurstyRuns;
    row.bursty_missed_s += std::abs(off_s) / kBurstyRuns;
  }
}

MethodRow method_row(PackageReader& package, PlanPictures& pictures, const DeliveryRequest& request) {
  const DeliveryPlan plan = plan_delivery(package, request);
  MethodRow row;
  row.displayed_px = request.displayed_px;
  row.scale = plan.scale;
  row.proxy = plan.proxy;
  row.triangles = plan.proxy ? package.manifest().proxies[*plan.proxy].triangles
                             : package.manifest().scales[package.scale_index(plan.scale)].triangles;
  row.bytes = plan.bytes();
  row.texture_bytes = plan.texture_bytes;
  row.predicted_flip = plan.flip;
  row.end_s = plan.complete_s;
  row.rendered =
      pictures.measure(shown_by(package, plan, list_of(package, request, plan)), request.displayed_px);
  play_bursts(package, request, request.network.link.at(0), row);
  return row;
}

SystemFigures figures_of(const MethodArguments& args, const System& system) {
  PackageReader package(open_store(system.package));
  const std::string against = is_package(args.input) ? args.against : args.input;
  PlanPictures pictures(package, against, args.views, context_of(args.jobs));
  SystemFigures out;
  out.name = system.printed ? "thesis" : "texmesh";
  for (const EntryRef& e : package.entries()) out.package_bytes += e.bytes;
  for (const ManifestScale& s : package.manifest().scales) out.scales.push_back(s.scale);
  out.steps =
      step_function(package.manifest().scales, system.printed ? StepRule::kDistance : StepRule::kFlip);
  for (const int px : args.displays_px)
    out.rows.push_back(method_row(package, pictures, method_request(args, system, px)));
  return out;
}

std::vector<System> systems_of(const MethodArguments& args, const fs::path& scratch) {
  if (!is_package(args.input))
    return {{compiled(args, scratch, ""), false}, {compiled(args, scratch, "thesis"), true}};
  return {{args.input, false}, {args.thesis.empty() ? args.input : args.thesis, true}};
}

Table method_table(const std::vector<const SystemFigures*>& systems) {
  Table table{"",
              {{"px", 0, "displayed_px"},
               Column::text("system"),
               {"shown", 0, "scale"},
               Column::data("proxy"),
               {"triangles", 0, "triangles"},
               {"kB", kKilobytes, "bytes"},
               {"textures kB", kKilobytes, "texture_bytes"},
               Column::data("predicted_flip"),
               {"FLIP", 4, "rendered_flip"},
               {"scale", 4, "rendered_geometry"},
               {"textures", 4, "rendered_textures"},
               {"end s", 2, "end_s"},
               {"bursts: late s", 2, "bursty_late_s"},
               {"off s", 2, "bursty_missed_s"}}};
  for (std::size_t k = 0; k < systems[0]->rows.size(); ++k)
    for (const SystemFigures* s : systems) {
      const MethodRow& r = s->rows[k];
      table.row({r.displayed_px, s->name,
                 Cell(r.scale, r.proxy ? fmt::format("proxy {}", *r.proxy) : fmt::format("S_{}", r.scale)),
                 r.proxy, r.triangles, r.bytes, r.texture_bytes, r.predicted_flip, r.rendered.whole,
                 r.rendered.geometry, r.rendered.textures, r.end_s, r.bursty_late_s, r.bursty_missed_s});
    }
  return table;
}

Json method_json(const std::vector<SystemFigures>& all) {
  Json systems = Json::array();
  for (const SystemFigures& s : all) {
    Json steps = Json::array();
    for (const ManifestStep& step : s.steps)
      steps.push_back({{"up_to_px", step.up_to_px}, {"scale", step.scale}});
    systems.push_back({{"system", s.name},
                       {"package_bytes", s.package_bytes},
                       {"scales", s.scales},
                       {"steps", steps},
                       {"rows", method_table({&s}).json()}});
  }
  return {{"method", systems}};
}

std::string method_text(const std::vector<SystemFigures>& all) {
  std::string text;
  std::vector<const SystemFigures*> systems;
  for (const SystemFigures& s : all) {
    systems.push_back(&s);
    text +=
        fmt::format("{}: {} kB, scales {}\n", s.name, kilobytes(s.package_bytes), fmt::join(s.scales, " "));
  }
  return text + method_table(systems).text();
}

int study_method_of(const MethodArguments& args) {
  const bool package = is_package(args.input);
  if (!package && !args.thesis.empty())
    throw UsageError("study method: --thesis", "", "a package in front of it", args.input);
  if (!package && !args.against.empty())
    throw UsageError("study method: --against", "", "a package in front of it", args.input);
  const ScratchFolder scratch("texmesh-method");
  std::vector<SystemFigures> all;
  for (const System& system : systems_of(args, scratch.path())) all.push_back(figures_of(args, system));
  std::cout << (args.json ? method_json(all).dump() + "\n" : method_text(all));
  return kExitOk;
}

void add_method_arguments(Command& c, MethodArguments& args) {
  c.option("INPUT", args.input,
           "A model, which is compiled twice, by default and with --profile thesis; or a package, which both "
           "systems read")
      .required();
  c.option("--thesis", args.thesis, "The package of --profile thesis, where INPUT is a package", "PKG");
  c.option("--against", args.against, "The model, for the source's texels, where INPUT is a package",
           "MODEL");
  c.option("--display", args.displays_px, "Displayed heights, px")
      .separated_by(',')
      .integer_in(16, 2048)
      .shows_default();
  add_time_option(c, args.delivery);
  args.delivery.request.network.link = BandwidthTrace::constant(250e3);
  args.delivery.needs_link = false;
  add_bandwidth_option(c, args.delivery, "Throughput of the link; the mean of the bursty ones")
      .shows_default("2Mbit/s");
  add_rtt_option(c, args.delivery, "Round trip: 40 or 40ms are milliseconds, 0.04s seconds");
  c.option("--views", args.views, "Directions that are rendered").integer_in(1, 64).shows_default();
  add_jobs_option(c, args.jobs);
  add_cache_options(c, args.cache);
  c.flag("--json", args.json, "Print one JSON object");
}

}  // namespace

void add_method_study(Command& study) {
  auto [c, args] =
      study.add("method", "The thesis as printed beside texmesh's defaults, on one model", study_method_of);
  add_method_arguments(c, args);
  c.examples(
      "  texmesh-lab study method turtle.glb --display 300,1000\n"
      "  texmesh-lab study method turtle.texmesh --thesis printed.texmesh --against turtle.glb --json");
  c.notes(
      "thesis: the package of --profile thesis, read with --policy thesis. texmesh: defaults on both sides. FLIP "
      "is of lit pictures against S_0 with the source's texels, 0 = equal: of what is shown, of the scale with "
      "the source's texels, of S_0 with the textures. Of a proxy, which has textures of its own, the last is the first.\n"
      "\"end s\" is over the link as told. Bursts: ten links of that mean whose rate varies by half of it "
      "(correlation 0.9 between tenths of a second); how late the last fragment is, and how far from the limit.\n"
      "Exit code: 0, 1 when a file cannot be read or compiled, 2 usage, 3 internal error.");
}

}  // namespace texmesh
