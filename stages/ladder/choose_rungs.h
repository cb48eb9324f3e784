#pragma once
// Inside the ladder only.
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"

namespace texmesh {

/// The rungs that are worth storing, by plane: rising indices into the rungs of `sample`, which needs only
/// the fragments of hull_sample(). Full-size planes keep all. Mips keep what worth_storing() or
/// keep_for_display() keeps: the one serves displays that could show more, the other displays that show the
/// mip itself. Incremental codecs need every rung below one that is kept. A negative `gain` keeps all. Same
/// result for any thread count.
std::vector<std::vector<std::size_t>> choose_rungs(const Fragments& fragments,
                                                   const std::vector<Pixels>& pixels,
                                                   const std::vector<PlaneLadder>& sample,
                                                   const Previews& previews, double gain,
                                                   const RunContext& context);

}  // namespace texmesh
