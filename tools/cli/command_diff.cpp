#include <nlohmann/json.hpp>

#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/diff/diff.h"

namespace texmesh {
namespace {

struct DiffArguments {
  std::array<std::string, 2> packages;
  bool json = false;
};

}  // namespace

void add_diff_command(Command& app) {
  auto args = std::make_shared<DiffArguments>();
  Command c = app.add("diff", "Say what differs between two packages, and why");
  c.option("A", args->packages[0], "A .texmesh file, or a folder that unpack made").required();
  c.option("B", args->packages[1], "The other package").required();
  c.flag("--json", args->json, "Print one JSON object with every entry (schemas/diff.v1.schema.json)");
  c.examples(
      "  texmesh diff old.texmesh new.texmesh\n"
      "  texmesh diff old.texmesh new.texmesh --json | jq '.recorded'");
  c.notes(
      "diff compares entries by digest, and the records of what the packages were made from: inputs, "
      "options, versions of stages and libraries. For each stage whose entries differ diff names the "
      "recorded differences that can reach the stage. diff does not decode meshes and textures; verify "
      "does.\n"
      "Exit code: 0 the same package, 4 different, 1 a package cannot be read, 2 usage.");
  c.on_run([args] {
    PackageReader a(open_store(args->packages[0])), b(open_store(args->packages[1]));
    const PackageDiff diff = diff_packages(a, b);
    if (args->json)
      std::cout << diff_json(diff, args->packages).dump() << '\n';
    else
      std::cout << diff_text(diff, args->packages);
    return diff.equal() ? kExitOk : kExitDifferent;
  });
}

}  // namespace texmesh
