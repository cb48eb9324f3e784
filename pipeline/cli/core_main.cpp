// texmesh-core: every command and the workers. People call texmesh (main.cpp), which starts it.
#include "format/container/format_version.h"
#include "pipeline/cli/commands.h"
#include "pipeline/cli/options/command_line.h"
#include "pipeline/compile/library_versions.h"
#include "pipeline/compile/workers/worker_child.h"

namespace texmesh {
namespace {

std::string version_details() {
  std::string text;
  for (const auto& [name, version] : library_versions()) text += name + " " + version + "\n";
  return text + "compiler " + compiler_version();
}

void add_commands(Command& program) {
  program.group("Make packages");
  add_compile_command(program);
  add_stages_command(program);
  add_cache_command(program);
  program.group("Look inside");
  add_view_command(program);
  add_dump_command(program);
  add_verify_command(program);
  add_diff_command(program);
  add_render_command(program);
  add_report_command(program);
  add_debug_command(program);
  add_doctor_command(program);
  program.group("Export");
  add_extract_command(program);
  add_unpack_command(program);
  add_pack_command(program);
  program.group("Deliver over a network");
  add_plan_command(program);
  add_check_command(program);
  add_fetch_command(program);
  add_simulate_command(program);
  program.group("Measure the method");
  add_study_command(program);
  add_experiment_command(program);
  add_completion_command(program);
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  if (argc == 2 && std::string(argv[1]) == "worker")
    return worker_main();  // started by compile, see pipeline/compile/workers/worker_child.h

  CommandLine line(kProgramSummary);
  line.version("texmesh " + tool_version() + ", package format " + std::to_string(kFormatMajor) + "." +
                   std::to_string(kFormatMinor),
               version_details());
  Command program = line.program();
  program.examples(
      "  texmesh compile scan.glb -o scan.texmesh     compile a model\n"
      "  texmesh dump scan.texmesh                    see what is in the package\n"
      "  texmesh verify scan.texmesh                  check every byte of the package\n"
      "  texmesh view scan.texmesh                    look at the package in a browser");
  program.notes("Every command explains itself: texmesh compile --help");
  add_commands(program);
  return line.run(argc, argv);
}
