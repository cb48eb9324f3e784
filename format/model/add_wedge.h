#pragma once
#include "format/model/model.h"

namespace texmesh {

/// One more wedge, at a position, with all attributes of a wedge of `from`, which may be the same mesh.
inline void add_wedge(Mesh& to, const Mesh& from, std::uint32_t wedge, std::uint32_t position) {
  to.wedge_position.push_back(position);
  const auto repeat = [wedge](auto& values, const auto& of) {
    if (!of.empty()) values.push_back(of[wedge]);
  };
  repeat(to.uv0, from.uv0), repeat(to.uv1, from.uv1), repeat(to.normals, from.normals);
  repeat(to.colours, from.colours), repeat(to.tangents, from.tangents);
}

}  // namespace texmesh
