#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/common_options.h"
#include "tools/inspect/package_tree.h"

namespace texmesh {

void add_unpack_command(Command& app) {
  struct Arguments {
    std::string package, folder, fragments = "packs";
    bool force = false;
  };
  auto args = std::make_shared<Arguments>();
  Command c =
      app.add("unpack", "Write a package's entries as files, for servers or tools that want a folder");
  c.option("PACKAGE", args->package, "A .texmesh file").required();
  c.option("-o,--output", args->folder, "The folder to make; it must be empty or not exist")
      .required()
      .value_name("DIR");
  c.option("--fragments", args->fragments,
           "packs: one file per texture and quality, as in the package. files: every fragment also as a "
           "complete JPEG with fragments.json beside, for servers that ignore Range requests")
      .one_of_explained({"packs", "files"})
      .value_name("packs|files")
      .shows_default();
  c.flag("--force", args->force,
         "Replace DIR where it holds an unpacked package; other folders are never replaced");
  c.examples(
      "  texmesh unpack bust.texmesh -o www/bust\n"
      "  texmesh unpack bust.texmesh -o www/bust --fragments files --force");
  c.notes(
      "The folder works like the file: dump, verify and clients take either. Any unzip tool makes the same "
      "files; unpack also checks every digest, and DIR appears whole or not at all.\n"
      "Exit code: 0, 1 when the package is damaged or DIR cannot be made, 2 usage.");
  c.on_run([args] {
    unpack_package(args->package, args->folder, {args->fragments == "files", args->force});
    return kExitOk;
  });
}

void add_pack_command(Command& app) {
  struct Arguments {
    std::string folder, package;
  };
  auto args = std::make_shared<Arguments>();
  Command c = app.add("pack", "Put an unpacked package together again, byte for byte");
  c.option("DIR", args->folder, "A folder that unpack made").required();
  c.option("-o,--output", args->package, "The .texmesh file to write").required().value_name("PKG");
  c.examples("  texmesh pack www/bust -o bust.texmesh");
  c.notes(
      "pack checks every file against its digest first. It refuses files that are not of the package and "
      "leaves fragment files out. The package appears whole or not at all.\n"
      "Exit code: 0, 1 when the folder is not an unpacked package or PKG cannot be written, 2 usage.");
  c.on_run([args] {
    pack_folder(args->folder, args->package);
    return kExitOk;
  });
}

}  // namespace texmesh
