#pragma once
// Inside proxies only: a soup without what has no place in a surface.
#include <cstdint>
#include <span>

#include "format/base/vec.h"
#include "format/model/model.h"
#include "stages/proxies/atlas_mesh.h"

namespace texmesh {

/// Whether triangles without an area stay: in a source they close cracks between their neighbours.
enum class ZeroArea : std::uint8_t { kKeep, kDrop };

/// Welds equal positions and drops triangles with equal, non-finite or missing corners, those that repeat
/// another one's corners and direction within a group, and positions without a triangle. Order stays.
ProxySurface clean_soup(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                        std::span<const std::uint32_t> group, ZeroArea zero_area);

}  // namespace texmesh
