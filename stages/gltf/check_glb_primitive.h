#pragma once
#include <limits>
#include <string>
#include <vector>

#include "format/base/vec.h"
#include "stages/gltf/glb_document.h"

namespace texmesh {

// A part of check_glb; no interface.

struct GlbBox {
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  Vec3d min{kInfinity, kInfinity, kInfinity}, max{-kInfinity, -kInfinity, -kInfinity};
  void extend(Vec3d p) {
    for (int k = 0; k < 3; ++k) {
      min[k] = std::min(min[k], p[k]);
      max[k] = std::max(max[k], p[k]);
    }
  }
  bool empty() const { return !(min.x <= max.x); }
};

/// What one primitive's data looks like after decoding.
struct GlbPrimitive {
  std::uint64_t triangles = 0, vertices = 0;
  GlbBox box;
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
