#pragma once
#include <array>
#include <vector>

#include "format/base/vec.h"
#include "stages/base/float_math.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// One directional light.
struct KeyLight {
  Vec3f towards{0, 1, 0};     // unit, from the object to the light
  Vec3f irradiance{0, 0, 0};  // linear RGB on a surface that faces the light: three.js' colour x intensity
};

/// Light from all around, prepared for shading. About 0.3 MB.
struct RenderEnvironment {
  static constexpr std::size_t kHarmonics = 25;  // of the bands 0 to 4
  /// Colours are padded with a 0, so that processors take all channels at once.
  std::array<Vec4f, kHarmonics> irradiance;  // spherical harmonics of irradiance / pi
  /// Prefiltered radiance as octahedral maps with a border of one texel, roughness i / (size - 1). At least
  /// two, or none where nothing shines.
  struct Level {
    std::uint32_t side = 0;     // texels with the border
    std::vector<Vec4f> texels;  // side x side
  };
  std::vector<Level> levels;
  KeyLight key;
  Vec3f background{0.2f, 0.2f, 0.2f};  // shown where nothing is: linear, behind the tone mapping
};

/// Radiance from a unit direction (world axes, +Y up); linear RGB, >= 0.
using Radiance = std::function<Vec3f(Vec3f direction)>;

/// The environment of all measurements: a studio with a soft sky, three soft boxes and a darker ground;
/// neutral grey as a whole, HDR up to about 6. A pure function with the same bits on every machine.
Vec3f studio_radiance(Vec3f direction);
/// Its key light: from above, to the right of +Z.
KeyLight studio_key_light();

/// Both are filtered as three.js r170 filters them, since that is what viewers see: by Gaussians of the
/// angle, whose width follows the roughness; irradiance by that of roughness 1, as spherical harmonics
/// (Ramamoorthi and Hanrahan 2001). Sampled without chance. At most about 0.15 s. Same bits for any thread
/// count.
RenderEnvironment prepare_environment(const Radiance& radiance, const KeyLight& key,
                                      const RunContext& context);
/// studio_radiance with studio_key_light, prepared when the library was built.
RenderEnvironment studio_environment();

/// Daylight in viewers and posters: radiance that paper mirrors from right above and from right below.
inline constexpr Vec3f kPaperAbove{0.955f, 0.955f, 0.955f}, kPaperBelow{0.653f, 0.627f, 0.577f};
/// Mirrors see a sky with more contrast: from this radiance so much brighter between two heights of the
/// direction, the lower one and what it is to the higher one.
inline constexpr float kMirrorLow = 0.3f, kMirrorRise = 1.4f, kMirrorFrom = -0.6f, kMirrorWidth = 1.5f;
/// Where the lamp is that the camera carries, along its axes, and how bright.
inline constexpr Vec3f kLampPlace{-0.5f, 0.7f, 1.0f};
inline constexpr float kLampIntensity = 2.2f;

/// The light in which viewers show objects (delivery/web/src/page/daylight.ts): daylight from above and a
/// lamp that the camera carries; `x`, `y`, `z` are its axes, unit, +z from the object to the camera. Metals
/// mirror a sky; without `metallic` surfaces shine under the lamp alone. A pure function with the same bits
/// on every machine.
RenderEnvironment daylight_environment(Vec3f x, Vec3f y, Vec3f z, bool metallic);

/// Irradiance / pi on a surface with that unit normal; >= 0.
Vec3f diffuse_light(const RenderEnvironment& environment, Vec3f normal);
Vec3<Lanes> diffuse_light(const RenderEnvironment& environment, Vec3<Lanes> normal);
/// The mean radiance that a lobe of that roughness (0..1) around the unit direction sees.
Vec3f specular_light(const RenderEnvironment& environment, Vec3f direction, float roughness);
Vec3<Lanes> specular_light(const RenderEnvironment& environment, Vec3<Lanes> direction, Lanes roughness);

}  // namespace texmesh
