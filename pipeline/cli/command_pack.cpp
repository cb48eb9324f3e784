#include <CLI/CLI.hpp>
#include <memory>

#include "pipeline/cli/commands.h"
#include "pipeline/inspect/package_tree.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {

void add_unpack_command(CLI::App& app, int& exit_code) {
  struct Arguments {
    std::string package, folder, fragments = "packs";
    bool force = false;
  };
  auto args = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand(
      "unpack", "Write a package's entries as files, for servers or tools that want a folder");
  c->add_option("package", args->package, "A .texmesh file")->required();
  c->add_option("-o,--output", args->folder, "The folder to make; it must not exist or be empty")
      ->required()
      ->type_name("DIR");
  c->add_option("--fragments", args->fragments,
                "packs: one file per texture and quality, as in the package. files: every fragment also as a "
                "complete JPEG "
                "with fragments.json beside, for servers that ignore Range requests")
      ->check(CLI::IsMember({"packs", "files"}))
      ->type_name("packs|files")
      ->capture_default_str();
  c->add_flag("--force", args->force,
              "Replace DIR if it holds an unpacked package; other folders are never replaced");
  c->footer(
      "The folder works like the file: dump, verify and clients take either. Any unzip tool makes the same "
      "files; this\n"
      "command also checks every digest, and DIR appears whole or not at all.\n"
      "Examples:\n"
      "  texmesh unpack bust.texmesh -o www/bust\n"
      "  texmesh unpack bust.texmesh -o www/bust --fragments files --force\n"
      "Exit code: 0, 1 when the package is damaged or DIR cannot be made, 2 usage.");
  c->callback([args, &exit_code] {
    unpack_package(args->package, args->folder, {args->fragments == "files", args->force});
    exit_code = kExitOk;
  });
}

void add_pack_command(CLI::App& app, int& exit_code) {
  struct Arguments {
    std::string folder, package;
  };
  auto args = std::make_shared<Arguments>();
  CLI::App* c = app.add_subcommand("pack", "Put an unpacked package together again, byte for byte");
  c->add_option("folder", args->folder, "A folder that unpack made")->required()->type_name("DIR");
  c->add_option("-o,--output", args->package, "The .texmesh file to write")->required()->type_name("PKG");
  c->footer(
      "Every file is checked against its digest first; files that are not of the package are refused, "
      "fragment files are\n"
      "left out. The package appears whole or not at all.\n"
      "Example:\n"
      "  texmesh pack www/bust -o bust.texmesh\n"
      "Exit code: 0, 1 when the folder is not an unpacked package or PKG cannot be written, 2 usage.");
  c->callback([args, &exit_code] {
    pack_folder(args->folder, args->package);
    exit_code = kExitOk;
  });
}

}  // namespace texmesh
