// texmesh-core: every command and the workers. People call texmesh (main.cpp), which starts it.
#include <string>

#include "pipeline/compile/library_versions.h"
#include "pipeline/compile/workers/sandbox.h"
#include "pipeline/compile/workers/worker.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/program.h"

namespace texmesh {
namespace {

/// What reaches the bytes of packages, and what bounds a model's process on this machine.
std::string version_details() {
  std::string text;
  for (const auto& [name, version] : library_versions()) text += name + " " + version + "\n";
  return text + "compiler " + compiler_version() + "\nsandbox: " + describe_sandbox(sandbox_support());
}

void add_commands(Command& program) {
  program.group("Make packages");
  add_compile_command(program);
  add_stages_command(program);
  add_cache_command(program);
  add_list_command(program);
  add_summary_command(program);
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
  add_export_command(program);
  add_site_command(program);
  add_unpack_command(program);
  add_pack_command(program);
  program.group("Deliver over a network");
  add_plan_command(program);
  add_check_command(program);
  add_fetch_command(program);
  add_simulate_command(program);
  add_completion_command(program);
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  if (argc == 2 && std::string(argv[1]) == "worker")
    return worker_main();  // started by compile, see pipeline/compile/workers/worker.h

  CommandLine line(kProgramSummary);
  describe_program(line, version_details);
  Command program = line.program();
  add_commands(program);
  return line.run(argc, argv);
}
