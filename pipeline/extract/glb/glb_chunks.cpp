#include "pipeline/extract/glb/glb_chunks.h"

#include "format/base/bounded_json.h"

namespace texmesh {

GlbChunks glb_chunks(std::span<const std::uint8_t> glb, const std::string& entry) {
  BytesIn in({glb.data(), glb.size()}, entry);
  in.raw(12);
  const std::uint32_t json_bytes = in.u32();
  in.u32();
  GlbChunks out{parse_bounded_json(in.raw(json_bytes), entry), {}};
  if (in.left() == 0) return out;
  const std::uint32_t binary_bytes = in.u32();
  in.u32();
  const auto binary = in.raw(binary_bytes);
  out.binary.assign(binary.begin(), binary.end());
  return out;
}

}  // namespace texmesh
