#include <iostream>

#include "format/base/errors.h"
#include "pipeline/batch/fleet/model_list.h"
#include "pipeline/compile/options.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/table.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/shard_options.h"

namespace texmesh {
namespace {

struct ListArguments {
  std::vector<std::string> inputs;
  std::string output, costs;
  int shards = 1;
  bool json = false;
};

int run_list(const ListArguments& args) {
  PlanRequest request;
  request.inputs = args.inputs;
  request.output = args.output;
  request.costs_s = costs_option(args.costs);
  const ModelList list = list_collection(request, args.shards);
  if (args.json) {
    std::cout << write_model_list(list);
    return kExitOk;
  }
  for (const ListedModel& m : list.models) {
    std::cout << m.input << " -> " << m.output << "  " << format_bytes(m.bytes);
    if (args.shards > 1) std::cout << "  shard " << m.shard;
    std::cout << '\n';
  }
  return kExitOk;
}

}  // namespace

void add_list_command(Command& app) {
  auto args = std::make_shared<ListArguments>();
  Command c = app.add("list");
  c.option("INPUT", args->inputs, "Models, folders of models, or collections (.json), as compile takes them")
      .required();
  c.option("-o,--output", args->output, "Where the packages would go, as compile takes it")
      .required()
      .value_name("OUTPUT");
  c.option("--shards", args->shards, "Say of every model which of so many shards compile --shard gives it to")
      .integer_in(1, 1'000'000);
  c.option("--costs", args->costs, "As for compile --shard").value_name("FILE");
  c.flag("--json", args->json, "Print JSON (schemas/list.v1.schema.json)");
  c.examples(
      "  texmesh list scans/ -o packages/                      what compile would make\n"
      "  texmesh list scans/ -o packages/ --shards 40 --json   for another engine");
  c.notes(
      "For Snakemake (examples/snakemake), Nextflow, make: names of packages, the files that each model names, "
      "and sizes. Nothing is compiled and no picture is opened.");
  c.on_run([args] {
    try {
      return run_list(*args);
    } catch (const InputError& e) {
      std::cerr << "texmesh list: " << e.what() << '\n';
      return static_cast<int>(kExitUsage);
    }
  });
}

}  // namespace texmesh
