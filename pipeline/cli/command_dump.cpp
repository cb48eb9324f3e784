#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/inspect/dump.h"

namespace texmesh {
namespace {

struct Arguments {
  std::string package;
  std::string part = "summary";
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
  c->add_flag("--json", args->json, "One JSON object, for programs");
  c->footer(
      "Examples:\n"
      "  texmesh dump bust.texmesh                      the page to read first\n"
      "  texmesh dump bust.texmesh ladder               what each texture quality costs\n"
      "  texmesh dump bust.texmesh scales --json        {\"scales\":[{\"scale\":0,\"triangles\":...}, ...]}\n"
      "  texmesh dump bust.texmesh entries | sort -n -k2   which entries are large\n"
      "Exit code: 0, 1 when the package cannot be read, 2 usage.");
  c->callback([args, &exit_code] {
    PackageReader package(open_store(args->package));
    const DumpPart part = part_of(args->part);
    if (args->json)
      std::cout << dump_json(package, part).dump() << '\n';
    else
      std::cout << dump_text(package, part);
    exit_code = kExitOk;
  });
}

}  // namespace texmesh
