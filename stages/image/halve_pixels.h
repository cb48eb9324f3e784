#pragma once
// Inside stages only: the coarser levels of a texture.
#include <cstdint>

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

enum class Halving : std::uint8_t {
  kLight,    // sRGB encoded: averaged in linear light
  kNormals,  // three channels of unit vectors, 0..255 for -1..1: averaged and made unit length again
  kNumbers   // averaged as they are
};

/// How a texture of that role is made smaller.
Halving halving_of(TextureRole role, std::uint32_t channels);

/// The first width x height texels of `from`, reduced to (width + 1) / 2 x (height + 1) / 2 by exact box
/// filtering. Output texel i covers [i w / o, (i + 1) w / o), so that texture coordinates mean the same at
/// every level whatever the size; with even sides that is the mean of 2 x 2. Values are rounded to nearest.
/// Normals that cancel out stay the mean that they are. The same bits on every machine.
Pixels halved(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Halving kind);

/// The same to an eighth, sides rounded up. Same result for any thread count.
Pixels eighth_of(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Halving kind,
                 const RunContext& context);

}  // namespace texmesh
