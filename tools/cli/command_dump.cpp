#include <nlohmann/json.hpp>
#include <optional>

#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/dump/dump.h"

namespace texmesh {

template <>
struct EnumNames<DumpPart> {
  static constexpr auto names = kDumpParts;
};

namespace {

struct DumpArguments {
  std::string package;
  DumpPart part = DumpPart::kSummary;
  std::optional<double> gamma;
  bool json = false;
};

int run_dump(const DumpArguments& args) {
  if (args.gamma && args.part != DumpPart::kTables && args.part != DumpPart::kAll)
    throw UsageError("--gamma", "", "the part tables or all", std::string(enum_name(args.part)));
  PackageReader package(open_store(args.package));
  if (args.json)
    std::cout << dump_json(package, args.part, args.gamma).dump() << '\n';
  else
    std::cout << dump_text(package, args.part, args.gamma);
  return kExitOk;
}

}  // namespace

void add_dump_command(Command& app) {
  auto args = std::make_shared<DumpArguments>();
  Command c = app.add("dump", "List the contents of a package and say what takes its bytes");
  add_package_argument(c, args->package, false);
  c.choice(
       "PART", args->part,
       "summary: bounds, scales, textures, bytes by kind, options. scales: the meshes and when each is "
       "enough. fragments: the texture's grid, importance and sizes. ladder: the rungs' bytes and "
       "distortion. tables: size model, allocation, measured quality. perceptual: how much scales differ, "
       "the thesis's Tables 7.1 and 7.2. atlas: charts of the textures and what they "
       "cost, as texmesh doctor has it; measured from S_0, which takes a moment. entries: every file with "
       "offset and "
       "digest. about: title, licence, unit and all else that is said about the object. provenance: inputs, "
       "options, versions. all: everything")
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
