#pragma once
#include <cstdint>

#include "stages/data/fragments.h"

namespace texmesh {

/// A plane of three channels that shows the surface in every texel: `columns` x `rows` fragments of one size
/// with equal parts of the surface and no features. All four above 0.
TexturePlane covered_plane(std::uint32_t columns, std::uint32_t rows, std::uint32_t fragment_width_px,
                           std::uint32_t fragment_height_px);

}  // namespace texmesh
