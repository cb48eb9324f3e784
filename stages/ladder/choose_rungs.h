#pragma once
// Inside the ladder only.
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"

namespace texmesh {

/// The rungs that are worth storing, by plane: rising indices into the rungs of `sample`, which holds at
/// least the fragments of choice_sample() at every candidate rung, of full-size planes and mips. What
/// pairs_worth_storing() keeps of 1,000 simulated loads of all textures together; the rung of a
/// source's coefficients always. Incremental codecs need every rung below one that is kept. `previews` are
/// those of all full-size planes. Same result for any thread count.
std::vector<std::vector<std::size_t>> choose_rungs(const Fragments& fragments,
                                                   const std::vector<Pixels>& pixels,
                                                   const std::vector<PlaneLadder>& sample,
                                                   const Previews& previews, const RunContext& context);

}  // namespace texmesh
