#pragma once
#include <vector>

#include "format/base/vec.h"
#include "stages/gltf/check_glb.h"
#include "stages/gltf/glb_document.h"

namespace texmesh {

// A part of check_glb; no interface.

/// Checks the tree of nodes and the scenes, and sets the positions and bounds of `facts`. `mesh_positions`:
/// per mesh those of all its primitives.
void check_glb_nodes(GlbDocument& document, const std::vector<std::vector<Vec3d>>& mesh_positions,
                     GlbFacts& facts);

}  // namespace texmesh
