#pragma once
// Pixels averaged over areas: the levels of a texture, and any smaller size.

#include "stages/base/run_context.h"
#include "stages/data/fragments.h"
#include "stages/data/pixels.h"

namespace texmesh {

enum class Averaging : std::uint8_t {
  kLight,    // sRGB encoded: averaged in linear light
  kNormals,  // three channels of unit vectors, 0..255 for -1..1: averaged and made unit length again
  kNumbers   // averaged as they are
};

/// How a texture of that role is made smaller.
Averaging averaging_of(TextureRole role, std::uint32_t channels);

/// The first width x height texels of `from`, of 1 or 3 channels, reduced to (width + 1) / 2 x (height + 1) /
/// 2 by exact box filtering. Output texel i covers [i w / o, (i + 1) w / o), so that texture coordinates mean
/// the same at every level whatever the size; with even sides that is the mean of 2 x 2. Values are rounded
/// to nearest, light in 16 bits. Normals that cancel out stay the mean that they are. The same bits on every
/// machine. StageError for other pixels.
Pixels halved(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Averaging kind);

/// The same to an eighth, sides rounded up. Same result for any thread count.
Pixels eighth_of(const Pixels& from, std::uint32_t width_px, std::uint32_t height_px, Averaging kind,
                 const RunContext& context);

/// The same to any smaller size, in single precision. Equal sizes give a copy. The same bits on every
/// machine.
///
/// `sharpening` s > 0 then filters both axes by (-s, 1 + 2 s, -s). Averaging and the bilinear interpolation
/// of whoever shows the image damp a frequency of f periods per texel by 1 - (pi f)^2 / 2 in all; s = 1/8
/// undoes that. Not for normals.
Pixels reduced(const Pixels& from, std::uint32_t used_width, std::uint32_t used_height, std::uint32_t width,
               std::uint32_t height, Averaging kind, float sharpening = 0);

/// Four channels, of colours of one or three and alpha, each texel of which covers as many of theirs.
Pixels joined_alpha(const Pixels& colours, const Pixels& alpha);
/// reduced() of all texels, of 1 to 4 channels. Alpha counts apart, as numbers; two channels become four.
Pixels reduced_with_alpha(const Pixels& from, std::uint32_t width, std::uint32_t height, Averaging kind);

}  // namespace texmesh
