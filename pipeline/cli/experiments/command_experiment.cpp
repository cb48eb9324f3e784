#include "pipeline/cli/commands.h"
#include "pipeline/cli/experiments/experiments.h"
#include "pipeline/cli/options/command_line.h"

namespace texmesh {

void add_experiment_command(Command& app) {
  Command c = app.add("experiment");
  c.needs_command();
  add_make_experiment(c);
  add_fit_experiment(c);
}

}  // namespace texmesh
