#pragma once
#include <cstdint>
#include <string>

#include "format/documents/textures.h"

namespace texmesh {

// How the text of a dump shows names.

/// The title line of a texture plane.
std::string plane_title(const TextureInfo& texture, std::size_t plane);

}  // namespace texmesh
