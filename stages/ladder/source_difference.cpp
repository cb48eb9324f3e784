#include "stages/ladder/source_difference.h"

#include <algorithm>
#include <cstdlib>
#include <vector>

#include "stages/data/coverage.h"
#include "stages/fragment_codec/fragment_codec.h"

namespace texmesh {

double source_difference(const TexturePlane& plane, const Pixels& pixels, const PlaneLadder& ladder) {
  constexpr std::size_t kMostFragments = 16;
  const std::size_t top = ladder.rungs.size() - 1;
  std::vector<std::size_t> stored;
  for (std::size_t f = 0; f < plane.fragment_count(); ++f)
    if (!fragment_stream(ladder.rungs[top], f).empty()) stored.push_back(f);
  const std::size_t count = std::min(stored.size(), kMostFragments);
  std::uint64_t sum = 0, samples = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const std::size_t f = stored[k * stored.size() / count];
    const TexelRectangle padded = padded_fragment_rectangle(plane, f), at = fragment_rectangle(plane, f);
    const Pixels decoded = decode_fragment(ladder, top, f, std::uint64_t{padded.width_px} * padded.height_px);
    for (std::uint32_t y = 0; y < at.height_px; ++y)
      for (std::uint32_t x = 0; x < at.width_px; ++x) {
        if (!plane.coverage.empty() && !CoverageMask(plane).covered(at.left_px + x, at.top_px + y)) continue;
        const std::uint8_t* from = pixels.at(at.left_px + x, at.top_px + y);
        for (std::uint32_t c = 0; c < pixels.channels; ++c)
          sum += static_cast<std::uint64_t>(std::abs(int{from[c]} - int{decoded.at(x, y)[c]}));
        samples += pixels.channels;
      }
  }
  return samples > 0 ? static_cast<double>(sum) / static_cast<double>(samples) : 0;
}

}  // namespace texmesh
