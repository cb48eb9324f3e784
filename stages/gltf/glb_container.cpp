#include "stages/gltf/glb_container.h"

#include <limits>

#include "format/base/bounded_json.h"

namespace texmesh {
namespace {

constexpr std::size_t kHeaderBytes = 12, kChunkHeaderBytes = 8;

void put_u32(Bytes& out, std::size_t x) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<std::uint8_t>(x >> shift));
}

std::size_t padded(std::size_t bytes) { return (bytes + 3) / 4 * 4; }

}  // namespace

void pad_to_four(Bytes& out, std::uint8_t with) { out.resize(padded(out.size()), with); }

Bytes glb_container(std::string_view json, ByteSpan binary) {
  const std::size_t bytes =
      kHeaderBytes + 2 * kChunkHeaderBytes + padded(json.size()) + padded(binary.size());
  constexpr std::size_t kMost = std::numeric_limits<std::uint32_t>::max();
  if (bytes > kMost)
    throw FormatError("GLB", "length",
                      "at most " + std::to_string(kMost) + " bytes, since lengths have 32 bits",
                      std::to_string(bytes));
  Bytes out;
  out.reserve(bytes);
  put_u32(out, kGlbMagic);
  put_u32(out, 2);
  put_u32(out, bytes);
  put_u32(out, padded(json.size()));
  put_u32(out, kGlbJsonChunk);
  out.insert(out.end(), json.begin(), json.end());
  pad_to_four(out, ' ');
  put_u32(out, padded(binary.size()));
  put_u32(out, kGlbBinaryChunk);
  out.insert(out.end(), binary.begin(), binary.end());
  pad_to_four(out, 0);
  return out;
}

GlbParts read_glb(ByteSpan glb, const std::string& entry) {
  BytesIn in(glb, entry);
  if (in.u32() != kGlbMagic) in.fail("a GLB", "another file");
  in.raw(8);
  const std::uint32_t json_bytes = in.u32();
  if (in.u32() != kGlbJsonChunk) in.fail("a JSON chunk", "another");
  GlbParts out{parse_bounded_json(in.raw(json_bytes), entry), {}};
  if (in.left() == 0) return out;
  const std::uint32_t binary_bytes = in.u32();
  in.u32();
  const ByteSpan binary = in.raw(binary_bytes);
  out.binary.assign(binary.begin(), binary.end());
  return out;
}

void forget_extension(nlohmann::ordered_json& root, const std::string& name) {
  for (const char* list : {"extensionsUsed", "extensionsRequired"}) {
    if (!root.contains(list)) continue;
    nlohmann::ordered_json kept = nlohmann::ordered_json::array();
    for (const nlohmann::ordered_json& n : root[list])
      if (n != name) kept.push_back(n);
    if (kept.empty())
      root.erase(list);
    else
      root[list] = kept;
  }
}

Bytes with_copyright(const Bytes& glb, const std::string& line) {
  if (line.empty()) return glb;
  GlbParts parts = read_glb(glb, "GLB");
  if (!parts.root.is_object() || !parts.root.contains("asset") || !parts.root["asset"].is_object())
    throw FormatError("GLB", "/asset", "an object", "none");
  parts.root["asset"]["copyright"] = line;
  return glb_container(parts.root.dump(), parts.binary);
}

}  // namespace texmesh
