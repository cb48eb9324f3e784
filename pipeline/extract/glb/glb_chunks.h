#pragma once
// Inside the room only: a GLB's JSON and its binary chunk.
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "format/base/bytes.h"

namespace texmesh {

struct GlbChunks {
  nlohmann::ordered_json root;
  Bytes binary;
};
/// Of a file that StandaloneGlb has checked or written. `entry` is for messages.
GlbChunks glb_chunks(std::span<const std::uint8_t> glb, const std::string& entry);

}  // namespace texmesh
