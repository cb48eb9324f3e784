// texmesh-lab: measures the method on packages and models. It is not part of what users of scans install.
#include "lab/cli/commands.h"
#include "pipeline/compile/library_versions.h"
#include "tools/cli/options/command_line.h"

int main(int argc, char** argv) {
  using namespace texmesh;
  CommandLine line("texmesh-lab measures what the method promises, on your own data and by your own judges.");
  line.version("texmesh-lab " + tool_version(), [] { return std::string(); });
  Command program = line.program();
  add_study_command(program);
  add_experiment_command(program);
  add_picture_command(program);
  return line.run(argc, argv);
}
