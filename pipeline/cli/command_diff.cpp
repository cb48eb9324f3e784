#include <CLI/CLI.hpp>
#include <iostream>
#include <memory>
#include <nlohmann/json.hpp>

#include "pipeline/cli/commands.h"
#include "pipeline/inspect/diff/diff.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

struct Arguments {
  std::array<std::string, 2> packages;
  bool json = false;
};

}  // namespace

void add_diff_command(CLI::App& app, int& exit_code) {
  auto args = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("diff", "Say what differs between two packages, and why");
  c->add_option("A", args->packages[0], "A .texmesh file, or a folder that unpack made")->required();
  c->add_option("B", args->packages[1], "The other one")->required();
  c->add_flag("--json", args->json, "One JSON object with every entry (schemas/diff.v1.schema.json)");
  c->footer(
      "Compares the packages' contents by digest, and what they were made from and with: inputs, options,\n"
      "versions of stages and libraries. For each stage whose entries differ it names the recorded "
      "differences\n"
      "that can reach it. Meshes and textures are not read; verify does that.\n"
      "Examples:\n"
      "  texmesh diff old.texmesh new.texmesh\n"
      "  texmesh diff old.texmesh new.texmesh --json | jq '.recorded'\n"
      "Exit code: 0 the same package, 4 different, 1 one cannot be read, 2 usage.");
  c->callback([args, &exit_code] {
    PackageReader a(open_store(args->packages[0])), b(open_store(args->packages[1]));
    const PackageDiff diff = diff_packages(a, b);
    if (args->json)
      std::cout << diff_json(diff, args->packages).dump() << '\n';
    else
      std::cout << diff_text(diff, args->packages);
    exit_code = diff.equal() ? kExitOk : kExitDifferent;
  });
}

}  // namespace texmesh
