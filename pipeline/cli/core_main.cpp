// texmesh-core: every command and the workers. People call texmesh (main.cpp), which starts it.
#include <iostream>
#include <set>
#include <string>

#include "pipeline/cli/commands.h"
#include "pipeline/cli/options/command_line.h"
#include "pipeline/cli/program.h"
#include "pipeline/compile/workers/sandbox/sandbox.h"
#include "pipeline/compile/workers/worker_child.h"

namespace texmesh {
namespace {

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
}

/// `--version --verbose` says what bounds a model's process on this machine.
void print_sandbox_of_version(int argc, char** argv) {
  const std::set<std::string> words(argv + 1, argv + argc);
  if (words == std::set<std::string>{"--version", "--verbose"})
    std::cout << "sandbox: " << describe_sandbox(sandbox_support()) << std::endl;
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  if (argc == 2 && std::string(argv[1]) == "worker")
    return worker_main();  // started by compile, see pipeline/compile/workers/worker_child.h

  print_sandbox_of_version(argc, argv);
  CommandLine line(kProgramSummary);
  describe_program(line);
  Command program = line.program();
  add_commands(program);
  return line.run(argc, argv);
}
