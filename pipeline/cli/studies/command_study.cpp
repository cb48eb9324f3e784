#include "pipeline/cli/commands.h"
#include "pipeline/cli/options/command_line.h"
#include "pipeline/cli/studies/studies.h"

namespace texmesh {

void add_study_command(Command& app) {
  Command c = app.add("study");
  c.needs_command();
  add_fragments_study(c);
  add_quality_study(c);
  add_method_study(c);
  add_prediction_study(c);
  add_rungs_study(c);
  add_thesis_study(c);
}

}  // namespace texmesh
