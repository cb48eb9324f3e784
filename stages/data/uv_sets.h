#pragma once

#include "format/model/model.h"

namespace texmesh {

/// Which sets of texture coordinates a material's textures use (0 -> uv0, 1 -> uv1).
struct UvSets {
  std::uint8_t guide = 0;  // the base colour's set; where that has no texture, the first texture's
  std::uint8_t both = 0;   // 1 = some texture uses the other set
  friend bool operator==(const UvSets&, const UvSets&) = default;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.guide, s.both);
  }
};

/// Per material; empty when all textures use the first set, as with nearly every model.
std::vector<UvSets> uv_sets_of(const std::vector<Material>& materials);

}  // namespace texmesh
