#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/dump/dump.h"

namespace texmesh {
namespace {

struct DumpArguments {
  std::string package;
  std::string part = "summary";
  std::optional<double> gamma;
  bool json = false;
};

DumpPart part_of(const std::string& name) {
  const auto it = std::find(kDumpParts.begin(), kDumpParts.end(), name);
  return static_cast<DumpPart>(it - kDumpParts.begin());
}

int run_dump(const DumpArguments& args) {
  const DumpPart part = part_of(args.part);
  if (args.gamma && part != DumpPart::kTables && part != DumpPart::kAll) {
    std::cerr << "texmesh dump: --gamma: expected with tables or all, found with " << args.part << '\n';
    return kExitUsage;
  }
  PackageReader package(open_store(args.package));
  if (args.json)
    std::cout << dump_json(package, part, args.gamma).dump() << '\n';
  else
    std::cout << dump_text(package, part, args.gamma);
  return kExitOk;
}

}  // namespace

void add_dump_command(Command& app) {
  auto args = std::make_shared<DumpArguments>();
  Command c = app.add("dump");
  add_package_argument(c, args->package, false);
  c.option(
       "PART", args->part,
       "summary: bounds, scales, textures, bytes by kind, options. scales: the meshes and when each is "
       "enough. fragments: the texture's grid, importance and sizes. ladder: the rungs' bytes and "
       "distortion. tables: size model, allocation, measured quality. perceptual: how much scales differ, the thesis's Tables 7.1 and 7.2. atlas: charts of the textures and what they "
       "cost, as texmesh doctor has it; measured from S_0, which takes a moment. entries: every file with offset and "
       "digest. about: title, licence, unit and all else that is said about the object. provenance: inputs, options, versions. all: everything")
      .one_of_explained({kDumpParts.begin(), kDumpParts.end()})
      .shows_default();
  c.option(
       "--gamma", args->gamma,
       "With tables: quality and bytes of every fragment at this Gamma (0 to 1) of the allocation, instead "
       "of the default Gamma, the mean of eta")
      .number_in(0, 1)
      .value_name("G");
  c.flag("--json", args->json, "Print one JSON object");
  c.examples(
      "  texmesh dump bust.texmesh                      the page to read first\n"
      "  texmesh dump bust.texmesh ladder               what each texture quality costs\n"
      "  texmesh dump bust.texmesh tables --gamma 0.3   what each fragment gets then\n"
      "  texmesh dump bust.texmesh entries | sort -n -k2   which entries are large");
  c.notes("Exit code: 0, 1 when the package cannot be read, 2 usage.");
  c.on_run([args] { return run_dump(*args); });
}

}  // namespace texmesh
