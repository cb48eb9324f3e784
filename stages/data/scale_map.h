#pragma once
#include <cstdint>
#include <vector>

#include "format/base/note.h"

namespace texmesh {

/// The scale map (thesis 2.4, 3.1): for every position the highest scale at which it is still a feature
/// point.
struct ScaleMap {
  int scales = 0;            // scale indices run 0 (original) .. scales
  std::vector<float> sigma;  // [scales + 1], of the largest component, object units; sigma[0] = 0
  std::vector<std::uint8_t> persistence;  // per position, 0..scales: extrema and zero crossings (geometry)
  std::vector<std::uint8_t> crossing;     // per position, 0..scales: zero crossings only (fragment density)
  std::vector<float> convergence;  // [scales + 1]: (max - min) of the smoothed signal, as a fraction of S_0's
  std::vector<std::uint32_t> crossings_at;  // [scales + 1]: positions at a zero crossing of that very scale;
                                            // [0]: all (mesh), samples at one of the raw grid (range)
  Notes notes;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.scales, s.sigma, s.persistence, s.crossing, s.convergence, s.crossings_at, s.notes);
  }
};

}  // namespace texmesh
