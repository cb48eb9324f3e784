#pragma once
// Inside the room only: a GLB's JSON and its binary chunk, and texture coordinates without a transform.
#include <nlohmann/json.hpp>
#include <span>
#include <string>

#include "format/base/bytes.h"
#include "format/model/model.h"

namespace texmesh {

struct GlbChunks {
  nlohmann::ordered_json root;
  Bytes binary;
};
/// Of a file that StandaloneGlb has checked or written. `entry` is for messages.
GlbChunks glb_chunks(std::span<const std::uint8_t> glb, const std::string& entry);

/// Multiplies the mesh's texture coordinates by the scale that KHR_texture_transform gives all textures of
/// the materials, and takes the extension out of the document, whose `mesh` this is. False, and nothing
/// changes, where textures differ, or where there is more than a scale.
bool bake_texture_scale(nlohmann::ordered_json& root, Mesh& mesh);

}  // namespace texmesh
