#pragma once
// Inside the ladder only: what rungs lose, measured in a few windows of a plane.
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/ladder/rung_hull.h"

namespace texmesh {

/// The full-size plane `base` and its mips, by level.
std::vector<std::size_t> chain_of(const Fragments& fragments, std::size_t base);

/// The fragments of every plane that choosing its rungs takes: all of full-size planes, of mips those that
/// measure_pairs() and measure_mip() look at. [plane][fragment], 1 or 0.
std::vector<std::vector<std::uint8_t>> hull_sample(const Fragments& fragments);

/// The pairs of the plane `base` and its mips, by (level, rung). Where a ladder lacks fragments, bytes are
/// what those it has let expect of the covered texels. Loss is measured in up to 6 windows of up to 128 px in
/// covered fragments evenly spread in index order: the decoded texels, scaled up bilinearly as a client does,
/// against `pixels` of the full size, over covered texels; luma of colours, every channel of data. Each
/// window weighs as much as its fragment's surface. `planes` are the ladders of `fragments`. Same result for
/// any thread count.
std::vector<RungPair> measure_pairs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                    const std::vector<PlaneLadder>& planes, std::size_t base,
                                    const RunContext& context);

/// A mip as a client meets it whose display needs no more texels: the preview (0 bytes), then the plane's
/// rungs, with the loss against the mip's own `pixels`. `preview_file`, a JPEG, is scaled up bilinearly.
/// Measured in up to 6 windows as measure_pairs() does. Empty where nothing is covered.
std::vector<MipChoice> measure_mip(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder,
                                   const std::vector<std::uint8_t>& preview_file, const RunContext& context);

}  // namespace texmesh
