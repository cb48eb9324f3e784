#include "lab/cli/commands.h"
#include "lab/cli/experiments/experiments.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

void add_experiment_command(Command& app) {
  Command c = app.add("experiment", "Ask judges what they can just tell, and fit their answers");
  c.needs_command();
  add_make_experiment(c);
  add_fit_experiment(c);
}

}  // namespace texmesh
