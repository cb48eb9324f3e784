#include <fmt/format.h>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <utility>

#include "delivery/cpp/decide/htc_theorem.h"
#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/cli/options/probe_options.h"
#include "tools/cli/simulate/lost_packets.h"
#include "tools/cli/simulate/simulated_link.h"
#include "tools/cli/simulate/simulated_page.h"
#include "tools/inspect/simulation_plot.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

constexpr int kPlotSamples = 400;

struct SimulateArguments : DeliveryArguments {
  std::string table, plot, picture;
  ProbeArguments probe;
  std::vector<std::string> beside;
  bool no_repeat = false;
  bool theorem = false, csv = false;
  int seeds = 20;
};

/// The thesis's limits of quality hold in its table.
HtcOptions table_options(const SimulateArguments& a) {
  HtcOptions o;
  o.hard_limits = true;
  o.order = a.order == "beta0"    ? HtcOrder::kBeta0
            : a.order == "finest" ? HtcOrder::kFinest
                                  : HtcOrder::kCredit;
  return o;
}

void print_table_4_2(const SimulateArguments& a) {
  const std::vector<Table42Row> rows = table_4_2(table_options(a), a.seeds);
  if (a.json) {
    Json list = Json::array();
    for (const Table42Row& r : rows)
      list.push_back({{"beta0", r.beta0_kb_s},
                      {"t0_s", r.t0_s},
                      {"deviation_percent", r.deviation_percent},
                      {"worst_percent", r.worst_percent},
                      {"trace_deviation_percent", r.trace_deviation_percent},
                      {"trace_worst_percent", r.trace_worst_percent},
                      {"static_percent", r.static_percent}});
    std::cout << Json{{"version", 1}, {"table", "4.2"}, {"rows", list}}.dump() << '\n';
    return;
  }
  if (a.csv) {
    std::cout << "beta0_kB_s,t0_s,deviation_percent,worst_percent,trace_deviation_percent,trace_worst_"
                 "percent,static_percent\n";
    for (const Table42Row& r : rows)
      std::cout << fmt::format("{},{:.4f},{:.5f},{:.5f},{:.5f},{:.5f},{:.4f}\n", r.beta0_kb_s, r.t0_s,
                               r.deviation_percent, r.worst_percent, r.trace_deviation_percent,
                               r.trace_worst_percent, r.static_percent);
    return;
  }
  Table table;
  for (const char* h :
       {"beta_0 [kB/s]", "T_0 [s]", "deviation [%]", "worst [%]", "by time [%]", "worst [%]", "static [%]"})
    table.column(h);
  for (const Table42Row& r : rows)
    table.row({fixed(r.beta0_kb_s, 0), fixed(r.t0_s, 2), fixed(r.deviation_percent, 3),
               fixed(r.worst_percent, 3), fixed(r.trace_deviation_percent, 3),
               fixed(r.trace_worst_percent, 3), fixed(r.static_percent, 1)});
  std::cout
      << "256 fragments, 418 kB, link 41.68 kB/s in the mean; deviation from T_0: mean and largest |.| of "
      << a.seeds
      << " runs,\nwith a throughput of its own for each fragment (cv 0.2), and over traces by time (cv 0.3)\n"
      << table.text();
}

constexpr double kTheoremLimit_s = 10;

/// One transfer per seed: 256 fragments one by one, each at a throughput of its own.
HtcTheorem theorem_run(const SimulateArguments& a, const std::vector<FragmentOffer>& offers, int seed,
                       int runs) {
  HtcOptions o = table_options(a);
  o.window = 1;
  o.hard_limits = false;
  o.time_limit_s = kTheoremLimit_s;
  o.throughput.initial_bytes_s = 20e3 + 33e3 * seed / runs;
  HarmonicTimePlan plan(offers, o);
  const BandwidthTrace samples =
      random_trace(41.68e3, 0.05 * (seed % 20), 0.5, 1, 300, static_cast<std::uint64_t>(seed));
  double now = 0;
  while (const HtcStep* s = plan.next(now)) {
    now += s->bytes / samples.bytes_s[s->position];
    plan.completed(s->offer, now);
  }
  return theorem_of(plan);
}

/// What of the theorem holds over all runs.
struct TheoremSummary {
  double identity_error = 0, largest_surplus_s = 0;  // the error as a share of T_0
  int corrected_broken = 0, published_broken = 0;
  explicit TheoremSummary(const std::vector<HtcTheorem>& runs) {
    for (const HtcTheorem& t : runs) {
      const double surplus = std::abs(t.surplus_s);
      identity_error = std::max(identity_error, std::abs(t.surplus_s - t.last_residual_s) / kTheoremLimit_s);
      largest_surplus_s = std::max(largest_surplus_s, surplus);
      corrected_broken += surplus > t.corrected_bound_s * (1 + 1e-9) + 1e-8;
      published_broken += surplus > std::abs(t.published_bound_s) + 1e-8;
    }
  }
};

Json theorem_json(const std::vector<HtcTheorem>& runs, const TheoremSummary& sum) {
  Json rows = Json::array();
  for (const HtcTheorem& t : runs)
    rows.push_back({{"surplus_s", t.surplus_s},
                    {"last_residual_s", t.last_residual_s},
                    {"corrected_bound_s", t.corrected_bound_s},
                    {"published_bound_s", t.published_bound_s}});
  return {{"version", 1},
          {"runs", runs.size()},
          {"identity_error", sum.identity_error},
          {"largest_surplus_s", sum.largest_surplus_s},
          {"corrected_bound_broken", sum.corrected_broken},
          {"published_bound_broken", sum.published_broken},
          {"rows", rows}};
}

std::string theorem_csv(const std::vector<HtcTheorem>& runs) {
  std::string csv = "run,surplus_s,last_residual_s,corrected_bound_s,published_bound_s\n";
  for (std::size_t i = 0; i < runs.size(); ++i)
    csv += fmt::format("{},{:.9g},{:.9g},{:.9g},{:.9g}\n", i + 1, runs[i].surplus_s, runs[i].last_residual_s,
                       runs[i].corrected_bound_s, runs[i].published_bound_s);
  return csv;
}

std::string theorem_text(const std::vector<HtcTheorem>& runs, const TheoremSummary& sum) {
  constexpr std::size_t kShown = 10;
  Table table;
  for (const char* h : {"run", "Pi [s]", "dT_n [s]", "corrected bound [s]", "published [s]"}) table.column(h);
  for (std::size_t i = 0; i < kShown; ++i) {
    const std::size_t at = (2 * i + 1) * runs.size() / (2 * kShown);
    const HtcTheorem& t = runs[at];
    table.row({std::to_string(at + 1), fixed(t.surplus_s, 6), fixed(t.last_residual_s, 6),
               fixed(t.corrected_bound_s, 6), fixed(t.published_bound_s, 6)});
  }
  return fmt::format(
      "{} runs of 256 fragments over random links, T_0 = {:.0f} s; some of them (--csv, --json: all):\n{}"
      "  Pi = dT_n                     largest error {:.1e} of T_0\n"
      "  largest |Pi|                  {:.4f} s\n"
      "  corrected bound               theta_n |beta_(n-1) / beta_n - 1| + rounding: broken in {} runs\n"
      "  Theorem 4.1 as published      broken in {} runs (its proof drops a term; a diagnostic only)\n",
      runs.size(), kTheoremLimit_s, table.text(), sum.identity_error, sum.largest_surplus_s,
      sum.corrected_broken, sum.published_broken);
}

void print_theorem(const SimulateArguments& a) {
  const std::vector<FragmentOffer> offers = table_4_2_offers();
  std::vector<HtcTheorem> runs;
  const int count = 50 * a.seeds;
  for (int seed = 1; seed <= count; ++seed) runs.push_back(theorem_run(a, offers, seed, count));
  const TheoremSummary sum(runs);
  if (a.json)
    std::cout << theorem_json(runs, sum).dump() << '\n';
  else
    std::cout << (a.csv ? theorem_csv(runs) : theorem_text(runs, sum));
}

std::vector<double> qualities_of(PackageReader& package, const DeliveryPlan& plan, const FragmentList& list) {
  std::vector<double> qualities;
  for (const HtcStep& s : plan.textures.steps)
    qualities.push_back(s.rung < 0 ? 0
                                   : package.tables()
                                         .planes[list.fragments[s.offer].plane]
                                         .rung_quality[static_cast<std::size_t>(s.rung)]);
  return qualities;
}

/// The whole counts from the first request on, the rest is of the textures alone (the thesis's T_0).
Json result_json(const DeliveryPlan& p, double limit_s) {
  const SimulationResult& r = p.textures;
  return {{"version", 1},
          {"scale", p.scale},
          {"first_picture_s", p.first_picture_s},
          {"mesh_s", p.mesh_s},
          {"complete_s", p.complete_s},
          {"whole_limit_s", limit_s},
          {"whole_deviation_percent", 100 * (limit_s - p.complete_s) / limit_s},
          {"whole_late_s", std::max(0.0, p.complete_s - limit_s)},
          {"time_limit_s", r.time_limit_s},
          {"end_s", r.end_s},
          {"deviation_percent", r.deviation_percent},
          {"late_s", r.late_s},
          {"bytes", r.bytes},
          {"fragments", r.rungs.size()},
          {"skipped", r.skipped},
          {"mean_quality", p.mean_quality},
          {"worst_quality", p.worst_quality},
          {"texture_flip", p.texture_flip},
          {"flip", p.flip},
          {"warnings", p.warnings}};
}

std::string steps_csv(const DeliveryPlan& p, const FragmentList& list, const std::vector<double>& qualities) {
  std::string csv =
      "position,plane,fragment,rung,quality,bytes,theta_s,credit_s,target_bytes,throughput_bytes_s,issued_s,"
      "done_s,residual_s\n";
  for (std::size_t i = 0; i < p.textures.steps.size(); ++i) {
    const HtcStep& s = p.textures.steps[i];
    csv += fmt::format("{},{},{},{},{},{},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g},{:.9g}\n", s.position,
                       list.fragments[s.offer].plane, list.fragments[s.offer].fragment, s.rung, qualities[i],
                       s.bytes, s.theta_s, s.credit_s, s.target_bytes, s.throughput_bytes_s, s.issued_s,
                       s.done_s, s.residual_s);
  }
  return csv;
}

std::string result_text(const DeliveryPlan& p, double limit_s) {
  const SimulationResult& r = p.textures;
  std::string text =
      fmt::format("S_{} complete {}, textures {}: deviation {:+.2f} % of {:.2f} s, late {:.3f} s\n", p.scale,
                  moment(p.mesh_s), moment(p.complete_s), 100 * (limit_s - p.complete_s) / limit_s, limit_s,
                  std::max(0.0, p.complete_s - limit_s));
  if (r.time_limit_s > 0)
    text += fmt::format("textures alone (T_0 = {:.3f} s): {:.3f} s, deviation {:+.2f} %, late {:.3f} s\n",
                        r.time_limit_s, r.end_s, r.deviation_percent, r.late_s);
  return text + fmt::format(
                    "{} bytes in {} fragments, {} skipped; quality {:.0f} in the mean, {:.0f} at worst; "
                    "predicted FLIP {:.4f} (0 = equal to the source)\n",
                    grouped(r.bytes), r.rungs.size(), r.skipped, p.mean_quality, p.worst_quality, p.flip);
}

/// Lost packets that nobody sends again take no time, but what was in them.
void simulate_lost_packets(const SimulateArguments& a, DeliveryRequest request) {
  const double loss = std::exchange(request.network.loss, 0);
  if (!(loss > 0)) throw UsageError("--no-repeat", "", "--loss above 0", "none");
  if (!a.picture.empty()) check_output_file(a.picture);
  PackageReader package(open_store(a.package));
  const DeliveryPlan plan = plan_delivery(package, request);
  const FragmentList list = plan.proxy ? FragmentList{} : list_of(package, request, plan);
  const LostPacketsTable table = lost_packets(package, plan, list, request, loss, request.network.seed);
  if (!a.picture.empty())
    write_output_file(a.picture, lost_packets_picture(package, plan.scale, loss, request.network.seed));
  std::cout << (a.json  ? lost_packets_json(table)
                : a.csv ? lost_packets_csv(table)
                        : lost_packets_text(table));
}

void simulate_package(const SimulateArguments& a) {
  DeliveryRequest request = delivery_request(a);
  request.probe = probe_options(a.probe);
  if (a.no_repeat) {
    simulate_lost_packets(a, request);
    return;
  }
  if (!a.beside.empty()) {
    std::cout << simulated_page(a.package, a.beside, request, a.json);
    return;
  }
  PackageReader package(open_store(a.package));
  const DeliveryPlan plan = plan_delivery(package, request);
  const FragmentList list = list_of(package, request, plan);
  const std::vector<double> qualities = qualities_of(package, plan, list);
  if (!a.plot.empty()) {
    BandwidthTrace link{{}, {}};
    const double span_s = std::max(1.1 * plan.textures.time_limit_s, 1e-3);
    for (int i = 0; i <= kPlotSamples; ++i) {
      link.time_s.push_back(span_s * i / kPlotSamples);
      link.bytes_s.push_back(request.network.link.at(plan.mesh_s + link.time_s.back()));
    }
    const std::string svg = simulation_svg(plan.textures, qualities, link,
                                           fmt::format("{}: S_{}, textures within {:.2f} s, {}", a.package,
                                                       plan.scale, plan.textures.time_limit_s, a.policy));
    write_output_file(a.plot, text_bytes(svg));
  }
  if (a.csv) {
    std::cout << steps_csv(plan, list, qualities);
    return;
  }
  if (a.json) {
    Json j = result_json(plan, request.time_limit_s);
    add_simulated_link(plan, request.network.link, j);
    std::cout << j.dump() << '\n';
    return;
  }
  std::cout << result_text(plan, request.time_limit_s) << simulated_link_text(plan, request.network.link);
  for (const std::string& w : plan.warnings) std::cout << "warning: " << w << '\n';
}

int run_simulate(const SimulateArguments& args) {
  const bool experiment = !args.table.empty() || args.theorem;
  if (!experiment && args.package.empty())
    throw UsageError("PACKAGE", "", "a package, --table or --theorem", "none of them");
  if (experiment && !args.package.empty())
    throw UsageError("PACKAGE", "", "no package with --table and --theorem", args.package);
  if (!args.table.empty()) print_table_4_2(args);
  if (args.theorem) print_theorem(args);
  if (!experiment) simulate_package(args);
  return kExitOk;
}

void add_play_options(Command& c, SimulateArguments& args) {
  Option beside =
      c.option(
           "--beside", args.beside,
           "Another package that shares link and time limit, and its displayed height in px; may be given "
           "again")
          .value_name("PKG[,PX]");
  c.flag("--no-repeat", args.no_repeat,
         "Packets of --loss are not sent again: a table of what that costs mesh and textures "
         "(HTTP sends them again)")
      .excludes(beside);
  c.option("--picture", args.picture,
           "With --no-repeat: a PNG of the mesh as it should be, with lost points at the mean of their "
           "neighbours, and by their texture coordinates")
      .value_name("FILE");
}

void add_output_options(Command& c, SimulateArguments& args) {
  c.option("--plot", args.plot, "Write an SVG: quality and time by fragment, throughput, credit")
      .value_name("FILE");
  Option json = c.flag("--json", args.json, "Print one JSON object (schemas/simulate.v1.schema.json)");
  c.flag("--csv", args.csv, "Print every decision, run or row as a line").excludes(json);
  c.group("The thesis's experiments");
  Option table = c.option("--table", args.table, "4.2: the experiment of Table 4.2 instead of a package")
                     .one_of_explained({"4.2"})
                     .value_name("4.2");
  c.flag("--theorem", args.theorem, "What Theorem 4.1 says and what holds, over random links")
      .excludes(table);
  c.option("--seeds", args.seeds, "Runs per row of the table").integer_in(1, 10000).shows_default();
}

}  // namespace

void add_simulate_command(Command& app) {
  auto args = std::make_shared<SimulateArguments>();
  Command c = app.add("simulate", "Play a transfer over a model of a network");
  add_delivery_options(c, *args, false);
  add_probe_options(c, args->probe);
  add_play_options(c, *args);
  add_output_options(c, *args);
  c.examples(
      "  texmesh simulate bust.texmesh --time 5 --bandwidth 2Mbit/s --rtt 50 --policy htca\n"
      "  texmesh simulate bust.texmesh --time 5 --trace monday.csv --policy price --plot monday.svg\n"
      "  texmesh simulate bust.texmesh --bandwidth 2Mbit/s --mirror 1Mbit/s --mirror 1Mbit/s,dead=2s\n"
      "  texmesh simulate bust.texmesh --display 600 --beside vase.texmesh,200 --time 3 --bandwidth 4Mbit/s\n"
      "  texmesh simulate bust.texmesh --bandwidth 2Mbit/s --loss 0.05 --no-repeat --picture lost.png\n"
      "  texmesh simulate --table 4.2 --json");
  c.notes(
      "The deviation is of the time limit: positive when the transfer ended early. --table and --theorem "
      "play the method itself and take --order, --seeds and the form of the output only.\n"
      "Exit code: 0, 1 when the package or the trace cannot be read, 2 usage.");
  c.on_run([args] { return run_simulate(*args); });
}

}  // namespace texmesh
