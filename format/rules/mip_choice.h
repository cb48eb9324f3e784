#pragma once

#include "format/documents/tables.h"
#include "format/documents/textures.h"

namespace texmesh {

/// How often the texels of a full-size plane may be halved until one stands for a pixel: log2 of texels per
/// pixel along a line, below 0 where there are fewer texels than pixels; 0 without covered texels.
/// `surface_area` of the object, object units squared; `object_height` = O_V.
double display_level(const PlaneTables& full_size, double surface_area, double object_height,
                     double displayed_px);

/// The plane of texture `base` with the largest mip that is at most `level`; `base` itself where there is
/// none.
std::uint32_t plane_at_level(std::span<const TextureInfo> textures, std::uint32_t base, double level);

}  // namespace texmesh
