#include "stages/ladder/choose_rungs.h"

#include <cstdint>
#include <numeric>
#include <utility>

#include "stages/ladder/rung_hull.h"
#include "stages/ladder/rung_loss.h"

namespace texmesh {
namespace {

// Where a mip is what the display shows, 1 - SSIM that its best rung must come down to. Scans of 2048 px:
// 0.02 is quality 86 to 93 and takes 12 % of the full size's bytes for all mips of a colour; 0.01 would take
// 20 %.
constexpr double kShownWell = 0.02, kDataShownWell = 0.03;
// Between the preview and that rung others are stored without which a client loses half more and over:
// factors of about two in bytes.
constexpr double kOwnGain = 0.5;

/// Indices of the rungs that `keep` marks, with those that they lean on.
std::vector<std::size_t> kept_indices(std::vector<std::uint8_t> keep, bool incremental) {
  if (incremental)
    for (std::size_t r = keep.size() - 1; r-- > 0;) keep[r] |= keep[r + 1];
  std::vector<std::size_t> out;
  for (std::size_t r = 0; r < keep.size(); ++r)
    if (keep[r]) out.push_back(r);
  return out;
}

}  // namespace

std::vector<std::vector<std::size_t>> choose_rungs(const Fragments& fragments,
                                                   const std::vector<Pixels>& pixels,
                                                   const std::vector<PlaneLadder>& sample,
                                                   const Previews& previews, double gain,
                                                   const RunContext& context) {
  RunContext quiet = context;
  quiet.progress = nullptr;
  std::vector<std::vector<std::size_t>> kept(sample.size());
  for (std::size_t p = 0; p < kept.size(); ++p) {
    kept[p].resize(sample[p].rungs.size());
    std::iota(kept[p].begin(), kept[p].end(), std::size_t{0});
  }
  for (std::size_t base = 0; base < fragments.planes.size(); ++base) {
    if (fragments.planes[base].mip > 0) break;
    const std::vector<std::size_t> chain = chain_of(fragments, base);
    if (chain.size() == 1 || gain < 0) continue;
    const std::vector<std::uint8_t> keep =
        worth_storing(measure_pairs(fragments, pixels, sample, base, quiet), gain);
    auto first = keep.begin();
    for (std::size_t level = 0; level < chain.size(); ++level) {
      const std::size_t p = chain[level];
      const auto last = first + static_cast<std::ptrdiff_t>(sample[p].rungs.size());
      std::vector<std::uint8_t> of_plane(first, last);
      first = last;
      if (level > 0)
        of_plane = keep_for_display(
            measure_mip(fragments.planes[p], pixels[p], sample[p], previews.planes[base].file, quiet),
            is_colour(fragments.planes[p].role) ? kShownWell : kDataShownWell, kOwnGain, std::move(of_plane));
      kept[p] = kept_indices(std::move(of_plane), codec_traits(sample[p].codec).incremental);
    }
  }
  return kept;
}

}  // namespace texmesh
