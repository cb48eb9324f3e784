#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "pipeline/cli/commands.h"
#include "pipeline/inspect/dump/dump.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

struct Arguments {
  std::string package;
  std::string part = "summary";
  std::optional<double> gamma;
  bool json = false;
};

DumpPart part_of(const std::string& name) {
  const auto it = std::find(kDumpParts.begin(), kDumpParts.end(), name);
  return static_cast<DumpPart>(it - kDumpParts.begin());
}

}  // namespace

void add_dump_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("dump", "Show what a package holds and why it is as large as it is");
  c->add_option("package", args->package, "A .texmesh file, or a folder that unpack made")->required();
  c->add_option(
       "part", args->part,
       "summary: bounds, scales, textures, bytes by kind, options. scales: the meshes and when each is "
       "enough. "
       "fragments: the texture's grid, importance and sizes. ladder: the rungs' bytes and distortion. "
       "tables: size "
       "model, allocation, measured quality. entries: every file with offset and digest. provenance: inputs, "
       "options, versions. all: everything")
      ->check(CLI::IsMember(std::vector<std::string>(kDumpParts.begin(), kDumpParts.end())))
      ->type_name("PART")
      ->capture_default_str();
  c->add_option("--gamma", args->gamma,
                "Of tables: quality and bytes of every fragment at this Gamma (0 to 1) of the allocation, "
                "instead of the default "
                "one, the mean of eta")
      ->check([](const std::string& text) {
        double value = -1;
        return CLI::detail::lexical_cast(text, value) && value >= 0 && value <= 1
                   ? std::string()
                   : "expected 0 to 1, found " + text;
      })
      ->type_name("G");
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "Examples:\n"
      "  texmesh dump bust.texmesh                      the page to read first\n"
      "  texmesh dump bust.texmesh ladder               what each texture quality costs\n"
      "  texmesh dump bust.texmesh tables --gamma 0.3   what each fragment gets then\n"
      "  texmesh dump bust.texmesh scales --json        {\"scales\":[{\"scale\":0,\"triangles\":...}, ...]}\n"
      "  texmesh dump bust.texmesh entries | sort -n -k2   which entries are large\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage.");
  c->callback([args, &exit_code] {
    const DumpPart part = part_of(args->part);
    if (args->gamma && part != DumpPart::kTables && part != DumpPart::kAll) {
      std::cerr << "texmesh dump: --gamma: expected with tables or all, found with " << args->part << '\n';
      exit_code = kExitUsage;
      return;
    }
    PackageReader package(open_store(args->package));
    if (args->json)
      std::cout << dump_json(package, part, args->gamma).dump() << '\n';
    else
      std::cout << dump_text(package, part, args->gamma);
    exit_code = kExitOk;
  });
}

}  // namespace texmesh
