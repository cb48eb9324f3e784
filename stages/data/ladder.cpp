#include "stages/data/ladder.h"

namespace texmesh {

std::span<const std::uint8_t> fragment_stream(const LadderRung& rung, std::size_t fragment) {
  return std::span(rung.data).subspan(rung.offset[fragment],
                                      rung.offset[fragment + 1] - rung.offset[fragment]);
}

std::uint64_t bytes_to_show(const PlaneLadder& plane, std::size_t rung, std::size_t fragment) {
  std::uint64_t bytes = 0;
  for (std::size_t r = codec_traits(plane.codec).incremental ? 0 : rung; r <= rung; ++r)
    bytes += fragment_stream(plane.rungs[r], fragment).size();
  return bytes;
}

}  // namespace texmesh
