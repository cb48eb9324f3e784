#include "lab/cli/commands.h"
#include "lab/cli/studies/studies.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

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

}  // namespace texmesh
