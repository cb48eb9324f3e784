#include "stages/fragment_codec/decode_rung.h"

#include "stages/fragment_codec/fragment_codec.h"

namespace texmesh {

std::vector<std::uint8_t> fragment_file(const PlaneLadder& plane, std::size_t rung, std::size_t fragment) {
  const bool incremental = codec_traits(plane.codec).incremental;
  std::vector<std::span<const std::uint8_t>> streams;
  for (std::size_t r = incremental ? 0 : rung; r <= rung; ++r)
    streams.push_back(fragment_stream(plane.rungs[r], fragment));
  return join_fragment(plane.codec, plane.rungs[incremental ? 0 : rung].table_stream, streams);
}

Pixels decode_fragment(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                       std::uint64_t max_pixels) {
  return decode_fragment_file(plane.codec, fragment_file(plane, rung, fragment), max_pixels);
}

Pixels decode_fragment_luma(const PlaneLadder& plane, std::size_t rung, std::size_t fragment,
                            std::uint64_t max_pixels) {
  return decode_fragment_file_luma(plane.codec, fragment_file(plane, rung, fragment), max_pixels);
}

}  // namespace texmesh
