#pragma once
#include <cstddef>

#include "stages/gltf/check_glb.h"
#include "stages/gltf/glb_document.h"

namespace texmesh {

// A part of check_glb; no interface. Each throws GlbDocument::Broken after a finding.

/// Decodes image `i` and adds its name to `facts`.
void check_glb_image(GlbDocument& document, std::size_t i, GlbFacts& facts);
void check_glb_texture(GlbDocument& document, std::size_t i);
void check_glb_material(GlbDocument& document, std::size_t i);

}  // namespace texmesh
