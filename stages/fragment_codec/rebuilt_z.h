#pragma once
#include "stages/data/pixels.h"
#include "stages/image/pixel_window.h"

namespace texmesh {

/// The z of unit vectors of whose components the bytes b stand for 2 b / 255 - 1 (SPEC.md, F24): the third
/// channel of every texel becomes what makes the length 1, never below 128. Of three channels; others stay.
void rebuild_z(Pixels& pixels);

/// What codec jpeg-xy codes: x and y of the vectors made as long as 1, and 128 for z. Of three channels.
Pixels without_z(const PixelWindow& window);

}  // namespace texmesh
