#pragma once
// Inside the room only: a proxy's mesh as streams of EXT_meshopt_compression.
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "format/base/bytes.h"
#include "stages/proxies/atlas_mesh.h"

namespace texmesh::proxies {

/// One stream. `packed` is what the file holds; decoded it has count * stride bytes.
struct MeshStream {
  Bytes packed;
  std::size_t stride = 0, count = 0;
};

/// The triangles of one group.
struct CodedGroup {
  std::uint32_t group = 0;
  MeshStream positions;  // three u16 and two bytes of 0, on the grid
  MeshStream normals;    // three i8, normalised, and a byte of 0; empty where there are none
  MeshStream uvs;        // two u16, normalised
  MeshStream indices;    // u16 or u32
  std::array<std::uint32_t, 3> least{}, most{};  // of the positions
  std::size_t triangles() const { return indices.count / 3; }
  std::size_t vertices() const { return positions.count; }
};

/// position = origin + step * grid place.
struct CodedMesh {
  Vec3f origin;
  float step = 1;
  std::vector<CodedGroup> groups;  // rising; none without triangles
  std::size_t bytes() const;       // of all packed streams
};

/// Positions on a grid of `position_bits` (4..16) along the longest side of the box. `normals`: per vertex,
/// unit; empty for none. `with_normals`: per group. Triangles with two corners in one place of the grid go.
/// No group is left where nothing is left.
CodedMesh code_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals,
                    const std::vector<bool>& with_normals, int position_bits);

/// The mesh that a reader gets: positions, normals and coordinates rounded as coded, but no triangle gone.
struct RoundedMesh {
  std::vector<Vec3f> positions, normals;
  std::vector<Vec2f> uvs;
};
RoundedMesh rounded_mesh(const AtlasMesh& mesh, const std::vector<Vec3f>& normals, int position_bits);

}  // namespace texmesh::proxies
