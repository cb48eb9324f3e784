#pragma once
#include <string>
#include <vector>

#include "format/base/box.h"
#include "stages/gltf/glb_document.h"

namespace texmesh {

// A part of check_glb; no interface.

/// What one primitive's data looks like after decoding.
struct GlbPrimitive {
  std::uint64_t triangles = 0, vertices = 0;
  Box3d box;
  std::vector<Vec3d> positions;
  void add(Vec3d p) {
    box.extend(p);
    positions.push_back(p);
  }
};

/// Decodes the primitive `json` at `place` and checks its accessors, indices and positions. Throws
/// GlbDocument::Broken after a finding.
GlbPrimitive check_glb_primitive(GlbDocument& document, const GlbDocument::Json& json,
                                 const std::string& place);

}  // namespace texmesh
