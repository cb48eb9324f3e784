#pragma once

#include "format/base/note.h"

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

}  // namespace texmesh
