#pragma once
// Inside the ladder only: what rungs lose, measured in a few windows of a plane.
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/ladder/rung_value.h"

namespace texmesh {

/// The full-size plane `base` and its mips, by level.
std::vector<std::size_t> chain_of(const Fragments& fragments, std::size_t base);

/// The fragments that measure_ways() looks at. [plane][fragment], 1 or 0.
std::vector<std::vector<std::uint8_t>> choice_sample(const Fragments& fragments);

/// The ways to show the texture of plane `base`. Where a ladder lacks fragments, bytes are what those it has
/// let expect of the covered texels. The rung of the source's coefficients is fixed. Losses are measured in
/// up to 6 windows of up to 128 px of the wanted level, in covered fragments evenly spread in index order:
/// what is shown, scaled up bilinearly as a client does, against the wanted level's `pixels`, over covered
/// texels; luma of colours, counted twice where their chroma is halved, but at most .02 more, every channel
/// of data. Each window weighs as much as its fragment's surface. `planes` are ladders of `fragments`;
/// `preview_file` is a complete JPEG. Same result for any thread count.
TextureWays measure_ways(const Fragments& fragments, const std::vector<Pixels>& pixels,
                         const std::vector<PlaneLadder>& planes, std::size_t base,
                         const std::vector<std::uint8_t>& preview_file, const RunContext& context);

}  // namespace texmesh
