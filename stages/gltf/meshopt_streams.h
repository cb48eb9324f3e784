#pragma once
// The bitstreams of EXT_meshopt_compression without filters: attributes of version 0, triangles of version 1.
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace texmesh {

/// `count` elements of `stride` bytes each (a multiple of 4, at most 256). `stage` is named by the StageError
/// of a stream that cannot be made.
std::vector<std::uint8_t> meshopt_attributes(std::span<const std::uint8_t> bytes, std::size_t count,
                                             std::size_t stride, const char* stage);

/// Triangles of `vertices` vertices; indices are a multiple of 3.
std::vector<std::uint8_t> meshopt_triangles(std::span<const std::uint32_t> indices, std::size_t vertices,
                                            const char* stage);

}  // namespace texmesh
