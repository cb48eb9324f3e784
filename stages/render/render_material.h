#pragma once
#include <array>
#include <cstdint>
#include <functional>

#include "format/model/model.h"

namespace texmesh {

/// What a material reads of a texture, as glTF has it.
enum class TextureUse : std::uint8_t {
  kBaseColour,         // sRGB colour, and alpha as a plain number
  kMetallicRoughness,  // green = roughness, blue = metallic
  kNormal,             // tangent space, +Y up
  kOcclusion,          // red
  kEmissive            // sRGB colour
};
inline constexpr std::size_t kTextureUses = 5;
/// Colours are sRGB encoded; the others are plain numbers.
constexpr bool is_srgb(TextureUse use) {
  return use == TextureUse::kBaseColour || use == TextureUse::kEmissive;
}

enum class MagFilter : std::uint8_t { kNearest, kLinear };
/// kLinear reads level 0 alone, kTrilinear blends two levels. Both are bilinear within a level.
enum class MinFilter : std::uint8_t { kNearest, kLinear, kTrilinear };

/// How a material reads one texture.
struct TextureSlot {
  std::int32_t texture = -1;  // index into the textures that shade() gets, -1 = none
  std::uint8_t uv_set = 0;    // 0 -> Mesh::uv0, 1 -> Mesh::uv1
  Wrap wrap_s = Wrap::kRepeat, wrap_t = Wrap::kRepeat;
  MagFilter mag_filter = MagFilter::kLinear;
  MinFilter min_filter = MinFilter::kTrilinear;
  UvTransform transform;
};

/// The metallic-roughness material of glTF 2.0. Factors are linear and lie in the ranges that glTF allows.
struct RenderMaterial {
  Vec4f base_colour{1, 1, 1, 1};
  float metallic = 1, roughness = 1;
  Vec3f emissive{0, 0, 0};
  float normal_scale = 1, occlusion_strength = 1;
  AlphaMode alpha_mode = AlphaMode::kOpaque;
  float alpha_cutoff = 0.5f;
  bool double_sided = false;
  bool unlit = false;  // base colour alone, tone-mapped like the rest
  std::array<TextureSlot, kTextureUses> textures;
  TextureSlot& slot(TextureUse use) { return textures[static_cast<std::size_t>(use)]; }
  const TextureSlot& slot(TextureUse use) const { return textures[static_cast<std::size_t>(use)]; }
};

/// The material without its extensions, but for the strength of emission. `texture_of` gives the index of the
/// texture that stands for a used reference, -1 = none. One image may stand for two textures, one sRGB and
/// one plain. All four of glTF's minification filters with mip levels become kTrilinear. Values that are not
/// finite become the defaults of glTF, others are clipped to its ranges.
RenderMaterial render_material(
    const Material& material,
    const std::function<std::int32_t(const TextureRef& reference, TextureUse use)>& texture_of);

}  // namespace texmesh
