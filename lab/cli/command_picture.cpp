#include "lab/cli/commands.h"
#include "lab/cli/picture_quantities.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/painting.h"

namespace texmesh {

void add_picture_command(Command& app) {
  auto args = std::make_shared<Painting>();
  Command c = app.add("picture", "Picture what a stage of the method computed, with a legend of its colours");
  c.option("INPUT", args->input, "A model; the stages that are needed run, through the cache").required();
  c.option("--what", args->what,
           "skeleton: the curve skeleton inside the shape. R: the distance to the skeleton, which errors are "
           "measured against. collapse-error: at which error a vertex was removed")
      .required()
      .one_of_explained({"skeleton", "R", "collapse-error"})
      .value_name("QUANTITY");
  c.option("-o,--output", args->output, "x.glb to turn in any viewer, or x.png for two views side by side")
      .required()
      .value_name("FILE");
  c.option("--size", args->size_px, "Side of one view of a PNG, px").integer_in(64, 4096).shows_default();
  add_painting_options(c, *args);
  add_jobs_option(c, args->jobs);
  c.flag("--json", args->json, "Print the legend as one JSON object");
  c.examples(
      "  texmesh-lab picture turtle.glb --what R -o turtle.png\n"
      "  texmesh-lab picture turtle.glb --what skeleton -o turtle.glb --set skeletonization.alpha_divisor=120");
  c.notes(
      "Colours run from dark violet (low) over teal to yellow (high); the legend on standard output gives their "
      "values. A GLB holds the colours as vertex colours and the skeleton as lines.\n"
      "Exit code: 0, 1 when the input cannot be shown, 2 usage, 3 internal error.");
  c.on_run([args] { return run_painting(*args, laboratory_quantities()); });
}

}  // namespace texmesh
