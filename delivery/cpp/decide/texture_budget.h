#pragma once
#include <cstdint>
#include <limits>
#include <vector>

#include "delivery/cpp/decide/fragment_list.h"

namespace texmesh {

/// The best texture that so many bytes can show.
struct TextureBudget {
  std::vector<PlaneChoice> planes;
  FragmentList list;
  std::vector<std::int32_t> rungs;  // by offer; -1 = skipped
  std::uint64_t bytes = 0;          // of fragments, at most the budget
  PerGroup losses{};                // of each group by itself
  double flip = 0;                  // of the picture with the scale
};

/// Chooses between the planes for the display and coarser and finer ones, so that few bytes are not spread
/// over too many texels, and bytes that are left show what a mean of texels per pixel hides. Spends the bytes
/// on fragments by rate and distortion (spend_bytes). What counts is the FLIP that is predicted of the
/// picture with ListOptions::scale. Finer planes, which take memory, must look better, not only as good.
///
/// Bytes are first spent by the sum of the groups' losses (ListOptions::group_weights = 1). Losses add up as
/// QualityTable::exponent says, so the groups' weights become those of that sum's slope where the bytes were
/// spent, and the bytes are spent again; the better choice stays. FragmentList::group_weights has its
/// weights.
TextureBudget texture_for_budget(PackageReader& package, const ListOptions& options, std::uint64_t bytes);
/// `loss` is for options.displayed_px. Where the planes take more than `memory_bytes` on the GPU, coarser
/// mips take their places (planes_within), and the bytes are spent on these.
TextureBudget texture_for_budget(TextureLoss& loss, const ListOptions& options, std::uint64_t bytes,
                                 double memory_bytes = std::numeric_limits<double>::infinity());

}  // namespace texmesh
