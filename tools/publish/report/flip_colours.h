#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "format/base/vec.h"
#include "stages/data/pixels.h"

namespace texmesh {

/// The colour of a value 0..1 (clipped) on a scale from black over purple and orange to pale yellow, whose
/// lightness rises evenly: it reads in grey, too. sRGB, 0..255.
Vec3<std::uint8_t> heat_colour(double value);

/// A square picture of FLIP values, `side_px` a side, in heat colours: 0 is black, `full` and more is the
/// last colour.
Pixels heat_picture(const std::vector<float>& values, std::uint32_t side_px, double full);

/// Such a colour for HTML: "#rrggbb".
std::string heat_hex(double value);

}  // namespace texmesh
