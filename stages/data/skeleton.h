#pragma once
#include <array>

#include "format/base/note.h"
#include "format/base/vec.h"

namespace texmesh {

/// The curve skeleton and the skeleton distance R(v) (thesis 6.2). Parts that contract to a point, and the
/// centroids of the fallbacks, are segments of no length.
struct Skeleton {
  std::vector<Vec3f> nodes;                            // mesh-local coordinates
  std::vector<std::array<std::uint32_t, 2>> segments;  // node indices
  // R(v) per position: the distance to the closest segment, at most what the local thickness allows; object
  // units, >= 0.
  std::vector<float> distance;
  std::vector<float> radius;       // R_eff(v) per position = max(R, floor * median R); > 0
  bool fallback_centroid = false;  // there was no wrap: distances are to the component's centroid
  Notes notes;
  static void archive(auto& s, auto& a) {
    a(s.nodes, s.segments, s.distance, s.radius, s.fallback_centroid, s.notes);
  }
};

}  // namespace texmesh
