// texmesh-core: every command and the workers. People call texmesh (main.cpp), which starts it.
#include <CLI/CLI.hpp>
#include <filesystem>
#include <iostream>

#include "format/base/errors.h"
#include "format/container/format_version.h"
#include "format/documents/manifest.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/units.h"
#include "pipeline/compile/library_versions.h"
#include "pipeline/compile/worker_child.h"
#include "pipeline/io/exit_codes.h"

int main(int argc, char** argv) {
  using namespace texmesh;
  if (argc == 2 && std::string(argv[1]) == "worker")
    return worker_main();  // started by compile, see pipeline/compile/worker_child.h

  CLI::App app{"texmesh compiles textured 3D scans into packages that any static web server can stream."};
  app.set_version_flag("--version", "texmesh " + tool_version() + ", package format " +
                                        std::to_string(kFormatMajor) + "." + std::to_string(kFormatMinor));
  app.require_subcommand(1);
  app.footer(
      "Start here:\n"
      "  texmesh compile scan.glb -o scan.texmesh     compile a model\n"
      "  texmesh dump scan.texmesh                    see what is in the package\n"
      "  texmesh verify scan.texmesh                  check every byte of it\n"
      "  texmesh view scan.texmesh                    look at it in a browser\n"
      "Each command explains itself: texmesh compile --help");
  int exit_code = kExitOk;
  try {
    add_compile_command(app, exit_code);
    add_cache_command(app, exit_code);
    add_dump_command(app, exit_code);
    add_diff_command(app, exit_code);
    add_verify_command(app, exit_code);
    add_unpack_command(app, exit_code);
    add_pack_command(app, exit_code);
    add_debug_command(app, exit_code);
    add_study_command(app, exit_code);
    add_plan_command(app, exit_code);
    add_check_command(app, exit_code);
    add_simulate_command(app, exit_code);
    add_fetch_command(app, exit_code);
    add_view_command(app, exit_code);
    add_extract_command(app, exit_code);
    add_stages_command(app, exit_code);
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    return app.exit(e) == 0 ? kExitOk : kExitUsage;
  } catch (const UsageError& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitUsage;
  } catch (const Error& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitModelFailed;
  } catch (const std::filesystem::filesystem_error& e) {
    std::cerr << "texmesh: " << e.what() << '\n';
    return kExitModelFailed;
  } catch (const std::exception& e) {
    std::cerr << "texmesh: internal error: " << e.what() << '\n';
    return kExitInternal;
  }
  return exit_code;
}
