#pragma once
#include "format/split/split_mesh.h"

namespace texmesh::testing {

/// The wedges of every face.
inline std::vector<std::array<std::uint32_t, 3>> face_wedges(const SplitMesh& mesh) {
  std::vector<std::array<std::uint32_t, 3>> out;
  for (std::uint32_t f = 0; f < mesh.face_count(); ++f)
    out.push_back({mesh.wedge_at(f, 0), mesh.wedge_at(f, 1), mesh.wedge_at(f, 2)});
  return out;
}

}  // namespace texmesh::testing
