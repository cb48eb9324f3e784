#include "stages/gltf/glb_copyright.h"

#include <nlohmann/json.hpp>

#include "format/base/bounded_json.h"
#include "format/base/errors.h"
#include "stages/gltf/glb_container.h"

namespace texmesh {

Bytes with_copyright(const Bytes& glb, const std::string& line) {
  if (line.empty()) return glb;
  BytesIn in(glb, "GLB");
  if (in.u32() != kGlbMagic) in.fail("a GLB", "another file");
  in.raw(8);
  const std::uint32_t json_bytes = in.u32();
  if (in.u32() != kGlbJsonChunk) in.fail("a JSON chunk", "another");
  nlohmann::ordered_json root = parse_bounded_json(in.raw(json_bytes), "GLB");
  if (!root.is_object() || !root.contains("asset") || !root["asset"].is_object())
    throw FormatError("GLB", "/asset", "an object", "none");
  root["asset"]["copyright"] = line;
  ByteSpan binary;
  if (in.left() > 0) {
    const std::uint32_t binary_bytes = in.u32();
    in.u32();
    binary = in.raw(binary_bytes);
  }
  return glb_container(root.dump(), binary);
}

}  // namespace texmesh
