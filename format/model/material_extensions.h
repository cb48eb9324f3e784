#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <string_view>

namespace texmesh {

/// Which channels of a texture a shader reads.
enum class TextureChannels : std::uint8_t { kColour, kAlpha, kBoth };

/// A texture that a material extension of glTF names.
struct ExtensionTextureKind {
  std::string_view key;  // "clearcoatTexture"
  bool colour = false;   // sRGB encoded; else linear data
  TextureChannels channels = TextureChannels::kColour;
  bool tangent_space = false;  // a normal map, or directions: needs tangents, and may have a "scale"
};

/// A number, or a vector of numbers, beside them.
struct ExtensionFactorKind {
  std::string_view key;
  int components = 1;
  double lowest = 0, highest = 1e30;  // what the extension allows; values are clipped to it
};

/// A material extension of glTF: carried from the source to the GLBs of all scales as it stands, or converted
/// to the base material by import.
struct MaterialExtensionKind {
  std::string_view name;
  std::span<const ExtensionFactorKind> factors;
  std::span<const ExtensionTextureKind> textures;
  bool converted = false;
  const ExtensionTextureKind* texture(std::string_view key) const {
    for (const ExtensionTextureKind& t : textures)
      if (t.key == key) return &t;
    return nullptr;
  }
};

/// All of them, by name. One line here is all that a further extension of this kind needs.
std::span<const MaterialExtensionKind> material_extensions();
/// Null for others.
const MaterialExtensionKind* find_material_extension(std::string_view name);

}  // namespace texmesh
