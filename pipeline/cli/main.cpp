// texmesh: compile and cache without the stages' libraries, whose loading alone takes longer than seeing that
// a collection of a thousand models is up to date; every other command is texmesh-core's.
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cerrno>
#include <cstring>
#include <iostream>

#include "format/base/errors.h"
#include "pipeline/cli/commands.h"
#include "pipeline/io/core_path.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

int start_core(char** argv) {
  const std::string core = core_executable();
  ::execv(core.c_str(), argv);
  throw InputError(core, "", "an executable that starts", std::strerror(errno));
}

int run_here(int argc, char** argv) {
  CLI::App app{"texmesh compiles textured 3D scans into packages that any static web server can stream."};
  app.require_subcommand(1);
  int exit_code = kExitOk;
  try {
    if (std::string(argv[1]) == "compile")
      add_compile_command(app, exit_code);
    else
      add_cache_command(app, exit_code);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kExitOk : kExitUsage;
  }
  return exit_code;
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  try {
    const std::string command = argc > 1 ? argv[1] : "";
    return command == "compile" || command == "cache" ? run_here(argc, argv) : start_core(argv);
  } catch (const Error& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitModelFailed;
  } catch (const std::exception& e) {
    std::cerr << "texmesh: internal error: " << e.what() << '\n';
    return kExitInternal;
  }
}
