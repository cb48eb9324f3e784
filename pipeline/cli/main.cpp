// texmesh: compile and cache without the stages' libraries, whose loading alone takes longer than seeing that
// a collection of a thousand models is up to date. Every other command is texmesh-core's.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <iostream>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options/command_line.h"
#include "pipeline/io/core_path.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

int start_core(char** argv) {
  const std::string core = core_executable();
  ::execv(core.c_str(), argv);
  std::cerr << "texmesh: " << core << ": expected an executable that starts, found " << std::strerror(errno)
            << '\n';
  return kExitModelFailed;
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  const std::string name = argc > 1 ? argv[1] : "";
  if (name != "compile" && name != "cache") return start_core(argv);
  CommandLine line(kProgramSummary);
  Command program = line.program();
  if (name == "compile")
    add_compile_command(program);
  else
    add_cache_command(program);
  return line.run(argc, argv);
}
