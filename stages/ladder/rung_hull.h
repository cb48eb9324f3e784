#pragma once
#include <cstdint>
#include <vector>

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/ladder.h"
#include "stages/data/pixels.h"
#include "stages/data/previews.h"

namespace texmesh {

/// One way to store a texture: a plane of the chain (0 = full size, 1 = its first mip, ...) at one rung.
struct RungPair {
  std::size_t level = 0, rung = 0;
  std::uint64_t bytes = 0;  // of all the rung's streams and its tables, exact
  double loss = 0;          // surface-weighted 1 - SSIM against the full-size plane, on a sample
};

/// Which pairs are worth storing. Kept are, of level 0, every rung, because allocation and run-time choice
/// within one size need them all, also where a mip would be cheaper; of mips those on the lower convex hull
/// of all pairs, loss over bytes, without which it would lie higher there by more than `gain` times its loss:
/// the least of them go one by one, each measured on the hull of what is left. A negative gain keeps all. Of
/// a level that would have none the pair that comes nearest to the hull stays, since a plane has at least one
/// rung. Pure; ties by order.
std::vector<std::uint8_t> worth_storing(const std::vector<RungPair>& pairs, double gain);

/// The fragments of every plane that choosing its rungs takes: all of full-size planes, of mips those that
/// measure_pairs() and measure_own() look at. [plane][fragment], 1 or 0.
std::vector<std::vector<std::uint8_t>> hull_sample(const Fragments& fragments);

/// The pairs of the plane `base` and its mips, by (level, rung). Where a ladder lacks fragments, bytes are
/// what those it has let expect of the covered texels. Loss is measured in up to 6 windows of up to
/// 128 px in covered fragments evenly spread in index order: the decoded texels, scaled up bilinearly as a
/// client does, against `pixels` of the full size, luma, or
/// every channel of data, over covered texels. Each window weighs as much as
/// its fragment's surface. Same result for any thread count.
std::vector<RungPair> measure_pairs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                    const Ladder& ladder, std::size_t base, const RunContext& context);

/// A mip as a client meets it whose display needs no more texels: the preview (0 bytes), then the plane's
/// rungs, with the loss against the mip's own `pixels`, the preview scaled up bilinearly from `preview`, a
/// JPEG. Measured in up to 6 windows as measure_pairs() does. Empty where nothing is covered.
std::vector<RungPair> measure_own(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder,
                                  const std::vector<std::uint8_t>& preview, const RunContext& context);

/// Adds to `keep`, by rung, what a mip needs to be shown for itself, given measure_own(): the first rung that
/// loses at most `shown_well`, else the last, and of those below it the vertices of the lower hull that
/// begins at the preview, without which the hull would lie higher by more than `gain`. Takes out of `keep`
/// rungs that show less than the preview does. At least one rung stays. Pure.
void keep_for_display(const std::vector<RungPair>& own, double shown_well, double gain,
                      std::vector<std::uint8_t>& keep);

/// Removes the rungs of mips that neither worth_storing() nor keep_for_display() keeps: the one serves
/// displays that could show more, the other those that show the mip itself. Rungs of incremental codecs lean
/// on those below, so there only rungs above the highest kept are removed. A negative gain keeps all. The
/// ladder needs only the fragments of hull_sample(). Returns the indices of the rungs that stay, by plane.
std::vector<std::vector<std::size_t>> drop_rungs_off_hull(const Fragments& fragments,
                                                          const std::vector<Pixels>& pixels,
                                                          const Previews& previews, double gain,
                                                          Ladder& ladder, const RunContext& context);

}  // namespace texmesh
