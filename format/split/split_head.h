#pragma once

#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

// Shared by reader and writer of mesh/stream.bin; no interface.

inline constexpr std::size_t kMostScales = 100;
inline constexpr std::uint32_t kMostSplits = 4096;  // of a block
/// Faces or splits per byte of a block, at most: so few bytes never become much mesh.
inline constexpr std::uint32_t kMostPerByte = 64;

std::vector<std::uint8_t> write_split_head(const SplitStreamHead& head);

/// A point of the octahedron |x| + |y| + |z| = 2^(bits - 1) - 1 (for codes 0 .. 2^bits - 2).
using OctahedralVector = std::array<std::int32_t, 3>;
OctahedralVector octahedral_vector(std::int32_t u, std::int32_t v, int bits);
/// Code of the direction of a vector, each coordinate of the octahedron rounded towards zero.
std::array<std::int32_t, 2> octahedral_place(std::array<std::int64_t, 3> sum, int bits);

/// Mean of an attribute over some wedges, rounded; of normals the direction of their sum.
std::array<std::int32_t, 4> split_mean(const SplitAttribute& attribute, std::size_t k, SplitMesh& mesh,
                                       const std::vector<std::uint32_t>& wedges);

}  // namespace texmesh
