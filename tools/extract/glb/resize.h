#pragma once
#include <cstdint>

#include "stages/data/pixels.h"

namespace texmesh {

enum class Averaging : std::uint8_t {
  kLight,    // sRGB encoded: averaged in linear light
  kNormals,  // three channels of unit vectors, 0..255 for -1..1: averaged and made unit length again
  kNumbers   // averaged as they are
};

/// The first `used_width` x `used_height` texels of an image of 1 or 3 channels, reduced to any smaller size
/// by exact area averaging: output texel i covers [i w / o, (i + 1) w / o), so that texture coordinates mean
/// the same at every size. Equal sizes give a copy. Rounded to nearest; the same bits on every machine.
///
/// `sharpening` s > 0 then filters both axes by (-s, 1 + 2 s, -s). Averaging and the bilinear interpolation
/// of whoever shows the image damp a frequency of f periods per texel by 1 - (pi f)^2 / 2 in all; s = 1/8
/// undoes that. Not for normals.
Pixels reduced(const Pixels& from, std::uint32_t used_width, std::uint32_t used_height, std::uint32_t width,
               std::uint32_t height, Averaging kind, float sharpening = 0);

}  // namespace texmesh
