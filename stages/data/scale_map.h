#pragma once
#include <array>

#include "format/base/note.h"
#include "format/base/vec.h"

namespace texmesh {

/// The scale map (thesis 2.4, 3.1): for every position the highest scale at which it is still a feature
/// point.
struct ScaleMap {
  int scales = 0;            // scale indices run from 0 (the original) to this one
  std::vector<float> sigma;  // [scales + 1], of the largest component, object units; sigma[0] = 0
  // Per position, 0..scales. Simplification asks for extrema and zero crossings, the density of features in
  // fragments counts zero crossings only.
  std::vector<std::uint8_t> persistence, crossing;
  std::vector<float> convergence;  // [scales + 1]: max - min of the smoothed signal, as a fraction of S_0's
  // [scales + 1]: positions at a zero crossing of that very scale. [0] counts all positions of a mesh, and of
  // a range scan the samples at a zero crossing of the raw grid.
  std::vector<std::uint32_t> crossings_at;
  Notes notes;
  static void archive(auto& s, auto& a) {
    a(s.scales, s.sigma, s.persistence, s.crossing, s.convergence, s.crossings_at, s.notes);
  }
};

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
