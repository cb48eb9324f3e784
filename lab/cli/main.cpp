// texmesh-lab: measures the method on packages and models. It is not part of what users of scans install.
#include "lab/cli/commands.h"
#include "pipeline/io/program.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {
namespace {

void add_study_command(Command& app) {
  Command c = app.add("study", "Measure on your own data what the method promises");
  c.needs_command();
  add_fragments_study(c);
  add_quality_study(c);
  add_method_study(c);
  add_prediction_study(c);
  add_rungs_study(c);
  add_thesis_study(c);
}

void add_experiment_command(Command& app) {
  Command c = app.add("experiment", "Ask judges what they can just tell, and fit their answers");
  c.needs_command();
  add_make_experiment(c);
  add_fit_experiment(c);
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  CommandLine line("texmesh-lab measures what the method promises, on your own data and by your own judges.",
                   "texmesh-lab");
  line.version("texmesh-lab " + tool_version(), [] { return std::string(); });
  Command program = line.program();
  program.examples(
      "  texmesh-lab study thesis -o thesis/                                 the thesis's tables, measured again\n"
      "  texmesh-lab simulate scan.texmesh --bandwidth 2Mbit/s --policy htca  play a transfer\n"
      "  texmesh-lab experiment make scan.texmesh -o page/                    a page for judges");
  program.notes("Every command explains itself: texmesh-lab study --help");
  add_study_command(program);
  add_experiment_command(program);
  add_lab_simulate_command(program);
  add_picture_command(program);
  add_completion_command(program);
  return line.run(argc, argv);
}
