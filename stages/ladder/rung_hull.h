#pragma once
// Inside the ladder only: which ways of storing a texture are worth their bytes.
#include <cstddef>
#include <cstdint>
#include <vector>

namespace texmesh {

/// One way to store a texture: a plane of the chain (0 = full size, 1 = its first mip, ...) at one rung.
struct RungPair {
  std::size_t level = 0, rung = 0;
  std::uint64_t bytes = 0;  // of all the rung's streams and its tables
  double loss = 0;          // surface-weighted 1 - SSIM against the full-size plane, on a sample
};

/// One way to show a mip whose display needs no more texels.
struct MipChoice {
  std::uint64_t bytes = 0;  // as RungPair::bytes
  double loss = 0;          // surface-weighted 1 - SSIM against the mip's own pixels, on a sample
};

/// Which pairs are worth storing. Kept are:
/// - of level 0 every rung, also where a mip would be cheaper: allocation and run-time choice within one size
///   need them all;
/// - of mips the pairs on the lower convex hull of all pairs, loss over bytes, without which the hull would
///   lie higher there by more than `gain` times its loss: the least of them go one by one, each measured on
///   the hull of what is left;
/// - of a level that would have none, the pair nearest to the hull, since a plane has at least one rung.
/// A negative gain keeps all. By pair, 1 or 0. Pure; ties by order.
std::vector<std::uint8_t> worth_storing(const std::vector<RungPair>& pairs, double gain);

/// `keep`, by rung, changed so that a mip can be shown for itself. `choices` are measure_mip()'s: the
/// preview, then the rungs. Added are:
/// - the first rung that loses at most `shown_well`, or the last rung where none does;
/// - of the rungs below it, the vertices of the lower hull that begins at the preview, without which the hull
///   would lie higher by more than `gain`.
/// Rungs that lose as much as the preview does are taken out. At least one rung stays. Pure.
std::vector<std::uint8_t> keep_for_display(const std::vector<MipChoice>& choices, double shown_well,
                                           double gain, std::vector<std::uint8_t> keep);

}  // namespace texmesh
