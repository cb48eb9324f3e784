// texmesh: compile, cache, help and version without the stages' libraries, whose loading alone takes longer
// than seeing that a collection of a thousand models is up to date. Every other command is texmesh-core's.
#include <unistd.h>

#include <cerrno>
#include <cstring>
#include <iostream>

#include "pipeline/io/core_path.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/command_list.h"
#include "tools/cli/options/told_errors.h"
#include "tools/cli/program.h"

namespace texmesh {
namespace {

int start_core(char** argv) {
  const std::string core = core_executable();
  ::execv(core.c_str(), argv);
  std::cerr << "texmesh: " << core << ": expected an executable that starts, found " << std::strerror(errno)
            << '\n';
  return kExitModelFailed;
}

/// The program with the names of its commands, and nothing behind them.
void describe_all(CommandLine& line) {
  describe_program(line, [] { return std::string(); });  // core's: its libraries are not loaded here
  Command program = line.program();
  for (const CommandSummary& command : kCommands) {
    program.group(command.group);
    program.add(command.name);
  }
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  const std::string name = argc > 1 ? argv[1] : "";
  const bool only_tells = argc == 2 && (name == "--version" || name == "--help" || name == "-h");
  if (!only_tells && name != "compile" && name != "cache")
    return run_telling_errors([&] { return start_core(argv); });
  CommandLine line(kProgramSummary);
  Command program = line.program();
  if (name == "compile")
    add_compile_command(program, {argv, static_cast<std::size_t>(argc)});
  else if (name == "cache")
    add_cache_command(program);
  else
    describe_all(line);
  return line.run(argc, argv);
}
