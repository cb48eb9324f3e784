#pragma once
#include <cstdint>
#include <span>
#include <string>

namespace texmesh {

/// Triangles that a model file says it has, at least, without reading its meshes: from the JSON of a GLB, the
/// header of a PLY, the size of a binary STL and the face lines of an OBJ. 0 where the file says nothing, or
/// more than its bytes could hold (the import finds out what is wrong).
std::uint64_t count_triangles(const std::string& file_name, std::span<const std::uint8_t> bytes);

}  // namespace texmesh
