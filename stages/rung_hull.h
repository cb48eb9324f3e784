#pragma once
#include <cstdint>
#include <vector>

#include "stages/fragmentation.h"
#include "stages/ladder.h"
#include "stages/run_context.h"

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

/// The pairs of the plane `base` and its mips, by (level, rung). Loss is measured in up to 6 windows of up to
/// 128 px in covered fragments evenly spread in index order: the decoded texels, scaled up bilinearly as a
/// client does, against `pixels` of the full size, luma over covered texels. Each window weighs as much as
/// its fragment's surface. Same result for any thread count.
std::vector<RungPair> measure_pairs(const Fragments& fragments, const std::vector<Pixels>& pixels,
                                    const Ladder& ladder, std::size_t base, const RunContext& context);

/// Removes the rungs of mips that worth_storing() does not keep. Rungs of
/// incremental codecs lean on those below, so there only rungs above the highest kept are removed.
void drop_rungs_off_hull(const Fragments& fragments, const std::vector<Pixels>& pixels, double gain,
                         Ladder& ladder, const RunContext& context);

}  // namespace texmesh
