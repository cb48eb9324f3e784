#include "stages/render/render_material.h"

#include <cmath>

namespace texmesh {
namespace {

float within(float value, float low, float high, float otherwise) {
  if (!std::isfinite(value)) return otherwise;
  return value < low ? low : value > high ? high : value;
}

float emission_strength(const Material& material) {
  for (const MaterialExtension& extension : material.extensions)
    if (extension.name == "KHR_materials_emissive_strength")
      for (const ExtensionFactor& factor : extension.factors)
        if (factor.key == "emissiveStrength" && !factor.values.empty())
          return within(factor.values[0], 0, 1e6f, 1);
  return 1;
}

MinFilter min_filter_of(Minification minification) {
  switch (minification) {
    case Minification::kNearest:
      return MinFilter::kNearest;
    case Minification::kLinear:
      return MinFilter::kLinear;
    default:  // the renderer has one filter with mip levels
      return MinFilter::kTrilinear;
  }
}

UvTransform finite_transform(const UvTransform& t) {
  const bool finite = std::isfinite(t.offset.x) && std::isfinite(t.offset.y) && std::isfinite(t.scale.x) &&
                      std::isfinite(t.scale.y) && std::fabs(t.rotation) <= 1e6f;
  return finite ? t : UvTransform{};
}

}  // namespace

RenderMaterial render_material(const Material& material,
                               const std::function<std::int32_t(const TextureRef&, TextureUse)>& texture_of) {
  constexpr float kMost = 1e6f;
  RenderMaterial out;
  const Vec4f c = material.base_colour;
  out.base_colour = {within(c.x, 0, 1, 1), within(c.y, 0, 1, 1), within(c.z, 0, 1, 1), within(c.w, 0, 1, 1)};
  out.metallic = within(material.metallic, 0, 1, 1);
  out.roughness = within(material.roughness, 0, 1, 1);
  for (int k = 0; k < 3; ++k)
    out.emissive[k] = within(material.emissive[k], 0, 1, 0) * emission_strength(material);
  out.normal_scale = within(material.normal_scale, -kMost, kMost, 1);
  out.occlusion_strength = within(material.occlusion_strength, 0, 1, 1);
  out.alpha_mode = material.alpha_mode;
  out.alpha_cutoff = within(material.alpha_cutoff, 0, kMost, 0.5f);
  out.double_sided = material.double_sided;
  out.unlit = material.unlit;
  const TextureRef* refs[kTextureUses] = {&material.base_colour_texture, &material.metallic_roughness_texture,
                                          &material.normal_texture, &material.occlusion_texture,
                                          &material.emissive_texture};
  for (std::size_t use = 0; use < kTextureUses; ++use) {
    const TextureRef& ref = *refs[use];
    if (!ref.used()) continue;
    TextureSlot& slot = out.textures[use];
    slot.texture = texture_of(ref, static_cast<TextureUse>(use));
    slot.uv_set = ref.texcoord;
    slot.wrap_s = ref.wrap_s;
    slot.wrap_t = ref.wrap_t;
    slot.mag_filter = ref.nearest ? MagFilter::kNearest : MagFilter::kLinear;
    slot.min_filter = min_filter_of(ref.minification);
    slot.transform = finite_transform(ref.transform);
  }
  return out;
}

}  // namespace texmesh
