#include "stages/gltf/glb_container.h"

#include <limits>
#include <string>

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

}  // namespace texmesh
