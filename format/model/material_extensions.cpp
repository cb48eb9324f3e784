#include "format/model/material_extensions.h"

namespace texmesh {
namespace {

using Channels = TextureChannels;
using Factor = ExtensionFactorKind;
using Texture = ExtensionTextureKind;

constexpr double kAny = 1e30;

constexpr std::array kAnisotropyFactors{Factor{"anisotropyStrength", 1, 0, 1},
                                        Factor{"anisotropyRotation", 1, -kAny}};
constexpr std::array kAnisotropyTextures{Texture{"anisotropyTexture", false, Channels::kColour, true}};

constexpr std::array kClearcoatFactors{Factor{"clearcoatFactor", 1, 0, 1},
                                       Factor{"clearcoatRoughnessFactor", 1, 0, 1}};
constexpr std::array kClearcoatTextures{Texture{"clearcoatTexture"}, Texture{"clearcoatRoughnessTexture"},
                                        Texture{"clearcoatNormalTexture", false, Channels::kColour, true}};

constexpr std::array kDiffuseTransmissionFactors{Factor{"diffuseTransmissionFactor", 1, 0, 1},
                                                 Factor{"diffuseTransmissionColorFactor", 3}};
constexpr std::array kDiffuseTransmissionTextures{
    Texture{"diffuseTransmissionTexture", false, Channels::kAlpha},
    Texture{"diffuseTransmissionColorTexture", true}};

constexpr std::array kDispersionFactors{Factor{"dispersion"}};
constexpr std::array kEmissiveStrengthFactors{Factor{"emissiveStrength"}};
constexpr std::array kIorFactors{Factor{"ior"}};

constexpr std::array kIridescenceFactors{Factor{"iridescenceFactor", 1, 0, 1}, Factor{"iridescenceIor", 1, 1},
                                         Factor{"iridescenceThicknessMinimum"},
                                         Factor{"iridescenceThicknessMaximum"}};
constexpr std::array kIridescenceTextures{Texture{"iridescenceTexture"},
                                          Texture{"iridescenceThicknessTexture"}};

constexpr std::array kSpecularGlossinessFactors{
    Factor{"diffuseFactor", 4, 0, 1}, Factor{"specularFactor", 3, 0, 1}, Factor{"glossinessFactor", 1, 0, 1}};
constexpr std::array kSpecularGlossinessTextures{Texture{"diffuseTexture", true},
                                                 Texture{"specularGlossinessTexture", true, Channels::kBoth}};

constexpr std::array kSheenFactors{Factor{"sheenColorFactor", 3, 0, 1},
                                   Factor{"sheenRoughnessFactor", 1, 0, 1}};
constexpr std::array kSheenTextures{Texture{"sheenColorTexture", true},
                                    Texture{"sheenRoughnessTexture", false, Channels::kAlpha}};

constexpr std::array kSpecularFactors{Factor{"specularFactor", 1, 0, 1}, Factor{"specularColorFactor", 3}};
constexpr std::array kSpecularTextures{Texture{"specularTexture", false, Channels::kAlpha},
                                       Texture{"specularColorTexture", true}};

constexpr std::array kTransmissionFactors{Factor{"transmissionFactor", 1, 0, 1}};
constexpr std::array kTransmissionTextures{Texture{"transmissionTexture"}};

constexpr std::array kVolumeFactors{Factor{"thicknessFactor"}, Factor{"attenuationDistance", 1, 1e-30},
                                    Factor{"attenuationColor", 3, 0, 1}};
constexpr std::array kVolumeTextures{Texture{"thicknessTexture"}};

constexpr std::array kKinds{
    MaterialExtensionKind{"KHR_materials_anisotropy", kAnisotropyFactors, kAnisotropyTextures},
    MaterialExtensionKind{"KHR_materials_clearcoat", kClearcoatFactors, kClearcoatTextures},
    MaterialExtensionKind{"KHR_materials_diffuse_transmission", kDiffuseTransmissionFactors,
                          kDiffuseTransmissionTextures},
    MaterialExtensionKind{"KHR_materials_dispersion", kDispersionFactors, {}},
    MaterialExtensionKind{"KHR_materials_emissive_strength", kEmissiveStrengthFactors, {}},
    MaterialExtensionKind{"KHR_materials_ior", kIorFactors, {}},
    MaterialExtensionKind{"KHR_materials_iridescence", kIridescenceFactors, kIridescenceTextures},
    MaterialExtensionKind{"KHR_materials_pbrSpecularGlossiness", kSpecularGlossinessFactors,
                          kSpecularGlossinessTextures, true},
    MaterialExtensionKind{"KHR_materials_sheen", kSheenFactors, kSheenTextures},
    MaterialExtensionKind{"KHR_materials_specular", kSpecularFactors, kSpecularTextures},
    MaterialExtensionKind{"KHR_materials_transmission", kTransmissionFactors, kTransmissionTextures},
    MaterialExtensionKind{"KHR_materials_volume", kVolumeFactors, kVolumeTextures},
};

}  // namespace

std::span<const MaterialExtensionKind> material_extensions() { return kKinds; }

const MaterialExtensionKind* find_material_extension(std::string_view name) {
  for (const MaterialExtensionKind& kind : kKinds)
    if (kind.name == name) return &kind;
  return nullptr;
}

}  // namespace texmesh
