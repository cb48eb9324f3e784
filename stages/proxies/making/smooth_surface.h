#pragma once
// Inside the room only.
#include "format/model/model.h"

namespace texmesh::proxies {

/// Whether normals turn within triangles on at least half of a mesh's area. False without normals.
bool is_smooth(const Mesh& mesh);

}  // namespace texmesh::proxies
