#pragma once
// Inside the room only.
#include <cstdint>
#include <span>

namespace texmesh::render {

/// The studio's environment as make_studio_table wrote it when the library was built: bits of floats, sides
/// of levels as numbers, in the order of RenderEnvironment's members without key and background.
std::span<const std::uint32_t> studio_table();

}  // namespace texmesh::render
