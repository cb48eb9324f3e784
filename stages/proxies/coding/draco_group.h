#pragma once
// Inside the room only: the triangles of one group as a stream of KHR_draco_mesh_compression.
#include <array>
#include <cstdint>
#include <vector>

#include "format/base/bytes.h"
#include "format/base/vec.h"

namespace texmesh::proxies {

/// What is coded: per vertex, in the vertices' order. Indices come in threes.
struct DracoInput {
  std::vector<Vec3f> positions, normals;  // normals: unit, or none
  std::vector<Vec2f> uvs;
  std::vector<std::uint32_t> indices;
  Vec3f origin;  // of the positions' grid
  float range = 1;
  int position_bits = 12, uv_bits = 12;  // uvs: of 0..1
};

struct DracoGroup {
  Bytes stream;                             // empty: none
  std::array<std::uint32_t, 3> ids{};       // of positions, normals, uvs in the stream
  std::size_t triangles = 0, vertices = 0;  // as a decoder gives them
};
/// Edgebreaker, each attribute with seams of its own, so positions are stored once. No stream where Draco
/// refuses the mesh.
DracoGroup code_draco_group(const DracoInput& input);

}  // namespace texmesh::proxies
