#pragma once
#include <cstdint>
#include <vector>

#include "stages/data/ladder.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// The complete image file of a stored fragment at a rung. FormatError when a part is damaged.
std::vector<std::uint8_t> fragment_file(const PlaneLadder& plane, std::size_t rung, std::size_t fragment);

/// Its pixels, or luma only. FormatError when it is damaged or has more than max_pixels.
Pixels decode_fragment(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels);

Pixels decode_fragment_luma(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                            std::uint64_t max_pixels);

}  // namespace texmesh
