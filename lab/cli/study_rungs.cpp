// texmesh-lab study rungs: which rungs loads choose.
#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "delivery/cpp/client/delivery_plan.h"
#include "format/rules/viewing.h"
#include "lab/cli/commands.h"
#include "pipeline/io/table.h"
#include "stages/fragment_codec/fragment_codec.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

struct RungArguments {
  std::vector<std::string> packages;
  int loads = 1000;
  double rtt_ms = 40;
  bool json = false;
};

/// How often loads show a plane, and its rungs.
struct PlaneUse {
  bool ends_with_source = false;  // its last rung stands for the source and is stored whatever loads choose
  std::size_t loads = 0;
  std::vector<std::size_t> chosen;  // by rung: loads in which some fragment has it
};

struct PackageUse {
  std::string package;
  std::vector<PlaneUse> planes;
  double flip = 0;  // predicted, mean over loads
};

/// Adds one load's planes and rungs.
void count_plan(const FragmentList& list, const DeliveryPlan& plan, std::vector<PlaneUse>& planes) {
  std::vector<std::vector<bool>> seen;
  for (const PlaneUse& plane : planes) seen.emplace_back(plane.chosen.size());
  for (std::size_t i = 0; i < list.offers.size(); ++i)
    if (plan.textures.rungs[i] >= 0)
      seen[list.fragments[i].plane][static_cast<std::size_t>(plan.textures.rungs[i])] = true;
  for (const PlaneChoice& choice : plan.planes) ++planes[choice.plane].loads;
  for (std::size_t p = 0; p < planes.size(); ++p)
    for (std::size_t r = 0; r < seen[p].size(); ++r) planes[p].chosen[r] += seen[p][r];
}

PackageUse play_loads(const std::string& path, const RungArguments& args) {
  PackageReader package(open_store(path));
  PackageUse out{path, {}, 0};
  for (std::size_t p = 0; p < package.textures().size(); ++p) {
    const TextureInfo& info = package.textures()[p];
    const PlaneTables& tables = package.tables().planes[p];
    const bool finest = info.mip == 0 && tables.rung_quality.back() == kFinestQuality;
    out.planes.push_back({info.source_rung || finest, 0, std::vector<std::size_t>(tables.rung_count())});
  }
  const std::vector<OrdinaryLoad> loads = ordinary_loads(static_cast<std::size_t>(args.loads));
  for (const OrdinaryLoad& load : loads) {
    DeliveryRequest request;
    request.displayed_px = load.displayed_px;
    request.time_limit_s = load.time_limit_s;
    request.network.link = BandwidthTrace::constant(load.bytes_s);
    request.network.rtt_s = args.rtt_ms / 1000;
    const DeliveryPlan plan = plan_delivery(package, request);
    count_plan(list_of(package, request, plan), plan, out.planes);
    out.flip += plan.flip / static_cast<double>(loads.size());
  }
  return out;
}

/// Rungs that less than a hundredth of the loads choose, but for the only one of a plane and for one that
/// stands for the source.
std::size_t rare_rungs(const PackageUse& use, int loads) {
  std::size_t count = 0;
  for (const PlaneUse& plane : use.planes) {
    if (plane.chosen.size() < 2) continue;
    const std::span<const std::size_t> chosen(plane.chosen.data(),
                                              plane.chosen.size() - (plane.ends_with_source ? 1 : 0));
    count += static_cast<std::size_t>(std::ranges::count_if(
        chosen, [&](std::size_t n) { return 100 * n < static_cast<std::size_t>(loads); }));
  }
  return count;
}

std::size_t all_rungs_of(const PackageUse& use) {
  std::size_t count = 0;
  for (const PlaneUse& plane : use.planes) count += plane.chosen.size();
  return count;
}

std::string uses_text(PackageReader& package, const PackageUse& use, int loads) {
  Table table{"",
              {"plane",
               "mip",
               "quality",
               {"kB", kKilobytes},
               {"plane shown %", percent_form()},
               {"rung chosen %", percent_form()}}};
  const auto share = [loads](std::size_t part) { return static_cast<double>(part) / loads; };
  for (std::size_t p = 0; p < use.planes.size(); ++p) {
    const PlaneTables& tables = package.tables().planes[p];
    for (std::size_t r = 0; r < tables.rung_count(); ++r) {
      std::uint64_t bytes = tables.table_bytes[r];
      for (std::size_t f = 0; f < tables.fragment_count(); ++f)
        bytes += tables.size_bytes[r * tables.fragment_count() + f];
      table.row({p, package.textures()[p].mip, tables.rung_quality[r], bytes, share(use.planes[p].loads),
                 share(use.planes[p].chosen[r])});
    }
  }
  return fmt::format(
      "{}\n{}{} of {} rungs are chosen in less than 1 % of {} loads, but for those of sources and the only ones "
      "of planes; mean predicted FLIP {:.4f}\n",
      use.package, table.text(), rare_rungs(use, loads), all_rungs_of(use), loads, use.flip);
}

Json uses_json(PackageReader& package, const PackageUse& use, int loads) {
  Json planes = Json::array();
  for (std::size_t p = 0; p < use.planes.size(); ++p)
    planes.push_back({{"plane", p},
                      {"mip", package.textures()[p].mip},
                      {"shown", use.planes[p].loads},
                      {"rung_quality", package.tables().planes[p].rung_quality},
                      {"chosen", use.planes[p].chosen}});
  return {{"package", use.package},
          {"loads", loads},
          {"planes", planes},
          {"rungs", all_rungs_of(use)},
          {"rare_rungs", rare_rungs(use, loads)},
          {"mean_flip", use.flip}};
}

int run_rungs(const RungArguments& args) {
  Json list = Json::array();
  for (const std::string& path : args.packages) {
    const PackageUse use = play_loads(path, args);
    PackageReader package(open_store(path));
    if (args.json)
      list.push_back(uses_json(package, use, args.loads));
    else
      std::cout << uses_text(package, use, args.loads) << std::flush;
  }
  if (args.json) std::cout << Json{{"packages", list}}.dump() << '\n';
  return kExitOk;
}

}  // namespace

void add_rungs_study(Command& study) {
  auto [c, args] =
      study.add("rungs", "Is every stored rung of use? How often ordinary loads choose it", run_rungs);
  c.option("PKG", args.packages, "Packages").required();
  c.option("--loads", args.loads, "Loads that are played").integer_in(1, 100000).shows_default();
  c.option("--rtt", args.rtt_ms, "Round trip, ms").number_in(0, 10000).shows_default();
  c.flag("--json", args.json, "Print one JSON object");
  c.examples(
      "  texmesh-lab study rungs turtle.texmesh\n  texmesh-lab study rungs *.texmesh --loads 200 --json");
  c.notes(
      "A load: a link of 2 to 50 Mbit/s, an object of 200 to 2,000 px, a limit of 1 to 10 s, each drawn from a "
      "logarithmic scale; the same loads on every machine. What a load shows is what texmesh plan says.\n"
      "\"plane shown\": loads that take this size of the texture; \"rung chosen\": loads in which a fragment at "
      "least has the rung. compile stores the rungs that are worth their bytes in such loads (--ladder.prune).\n"
      "Exit code: 0, 1 when a package cannot be read, 2 usage.");
}

}  // namespace texmesh
