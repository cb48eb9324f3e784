#include "tools/cli/program.h"

#include "format/container/format_version.h"
#include "pipeline/compile/library_versions.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

void describe_program(CommandLine& line, const std::function<std::string()>& version_details) {
  line.version("texmesh " + tool_version() + ", package format " + std::to_string(kFormatMajor) + "." +
                   std::to_string(kFormatMinor),
               version_details);
  Command program = line.program();
  program.examples(
      "  texmesh compile scan.glb -o scan.texmesh     compile a model\n"
      "  texmesh dump scan.texmesh                    see what is in the package\n"
      "  texmesh verify scan.texmesh                  check every byte of the package\n"
      "  texmesh view scan.texmesh                    look at the package in a browser");
  program.notes("Every command explains itself: texmesh compile --help");
}

}  // namespace texmesh
