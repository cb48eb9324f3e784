#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/cli/options/delivery_text.h"

namespace texmesh {
namespace {

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
  std::cout << (a.json ? simulated_json(plan, request.time_limit_s).dump() + '\n'
                       : simulated_text(plan, request.time_limit_s));
  return kExitOk;
}

}  // namespace

void add_simulate_command(Command& app) {
  auto args = std::make_shared<SimulateArguments>();
  Command c = app.add("simulate", "Play a transfer over a model of a network");
  add_delivery_options(c, *args);
  c.option("--plot", args->plot, "Write an SVG: quality and time by fragment, throughput, credit")
      .value_name("FILE");
  c.flag("--json", args->json, "Print one JSON object (schemas/simulate.v1.schema.json)");
  c.examples(
      "  texmesh simulate bust.texmesh --time 5 --bandwidth 2Mbit/s --rtt 50\n"
      "  texmesh simulate bust.texmesh --time 5 --trace monday.csv --plot monday.svg\n"
      "  texmesh simulate bust.texmesh --bandwidth 2Mbit/s --mirror 1Mbit/s --mirror 500kbit/s");
  c.notes(
      "The deviation is a share of the time limit. It is positive when the transfer ended early.\n"
      "Exit code: 0, 1 when the package or the trace cannot be read, 2 usage.");
  c.on_run([args] { return run_simulate(*args); });
}

}  // namespace texmesh
