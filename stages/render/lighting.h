#pragma once
// Inside the room only: how surfaces reflect light (glTF 2.0, appendix B). F is a float, or Lanes of as many
// surfaces, each of which gets the bits that it would get alone.
#include "stages/render/environment.h"
#include "stages/render/render_math.h"

namespace texmesh {

inline constexpr float kLeastRoughness = 0.0525f;  // three.js r170: what its prefiltered maps resolve

/// A point of a surface, lit or not yet. Linear RGB; directions in world axes.
template <Float F>
struct SurfaceOf {
  Vec3<F> normal{F{}, F{}, F{} + 1};  // unit, what a normal map makes of it
  Vec3<F> base_colour{F{} + 1, F{} + 1, F{} + 1}, emission;
  F metallic{};
  F roughness = F{} + 1;  // kLeastRoughness..1
  F occlusion = F{} + 1;  // 1 = open to the environment
};
using LitSurface = SurfaceOf<float>;

/// What reaches a viewer by a surface of that normal and roughness, whatever its colours.
template <Float F>
struct LightingOf {
  F n_dot_v{};
  F n_dot_l{};            // of the key light
  F mirrored{};           // specular BRDF of the key light, without Fresnel's part
  F schlick{};            // weight of the key light
  Vec2<F> split;          // split_sum
  Vec3<F> diffuse;        // diffuse_light
  Vec3<F> glossy;         // specular_light
  F occlusion = F{} + 1;  // the surface's
  F occluded = F{} + 1;   // what that leaves of glossy light
};

/// GGX distribution of half vectors; alpha = roughness^2.
template <Float F>
F ggx_distribution(F alpha, F n_dot_h) {
  const F a2 = alpha * alpha, d = n_dot_h * n_dot_h * (a2 - 1) + 1;
  return a2 / (kFloatPi * d * d);
}
/// Smith's height-correlated masking and shadowing, over 4 (n.l) (n.v).
template <Float F>
F smith_visibility(F alpha, F n_dot_l, F n_dot_v) {
  const F a2 = alpha * alpha;
  const F v = n_dot_l * root_of(a2 + (1 - a2) * n_dot_v * n_dot_v),
          l = n_dot_v * root_of(a2 + (1 - a2) * n_dot_l * n_dot_l);
  return 0.5f / (v + l > 1e-6f ? v + l : 1e-6f);
}
/// (1 - cos)^5
template <Float F>
F schlick_weight(F cosine) {
  const F c = 1 - cosine, c2 = c * c;
  return c2 * c2 * c;
}
/// Scale and bias of F0 in the mean reflectance of a lobe (Karis 2014, a fit of the split sum's table).
template <Float F>
Vec2<F> split_sum(F roughness, F n_dot_v) {
  const F x = 1 - roughness, y = 0.0425f - 0.0275f * roughness, z = 1.04f - 0.572f * roughness,
          w = 0.022f * roughness - 0.04f;
  const F squared = x * x, falling = exp2_of(-9.28f * n_dot_v);
  const F a004 = (squared < falling ? squared : falling) * x + y;
  return {z - 1.04f * a004, w + 1.04f * a004};
}

template <Float F>
Vec3<F> mixed(Vec3<F> a, Vec3<F> b, F part) {
  return a + (b - a) * part;
}
template <Float F>
Vec3<F> f0_of(const SurfaceOf<F>& s) {
  const F dielectric = F{} + 0.04f;
  return mixed({dielectric, dielectric, dielectric}, s.base_colour, s.metallic);
}

/// Lagarde and de Rousiers 2014: occlusion of what comes from the direction of the mirror.
template <Float F>
F specular_occlusion(F n_dot_v, F occlusion, F roughness) {
  if (!any(occlusion < 1)) return F{} + 1;
  const F base = n_dot_v + occlusion;
  const F power = exp2_of(exp2_of(-16 * roughness - 1) * log2_of(base < 1e-30f ? 1e-30f : base));
  const F occluded = saturated(power - 1 + occlusion);
  return occlusion < 1 ? (base > 0 ? occluded : 0.f) : 1.f;
}

template <Float F>
void add_key(const SurfaceOf<F>& s, Vec3f to_light, Vec3<F> to_viewer, LightingOf<F>& out) {
  const Vec3<F> light = each<F>(to_light);
  out.n_dot_l = saturated(dot(s.normal, light));
  if (!any(out.n_dot_l > 0)) return;
  const Vec3<F> half = normalized(light + to_viewer);
  const F n_dot_v = saturated(dot(s.normal, to_viewer)), n_dot_h = saturated(dot(s.normal, half)),
          v_dot_h = saturated(dot(to_viewer, half));
  const F alpha = s.roughness * s.roughness;
  out.mirrored = smith_visibility(alpha, out.n_dot_l, n_dot_v) * ggx_distribution(alpha, n_dot_h);
  out.schlick = schlick_weight(v_dot_h);
}

/// Light of a unit of irradiance from one direction.
template <Float F>
Vec3<F> reflected_from_key(const SurfaceOf<F>& s, const LightingOf<F>& lighting) {
  const F lambert = (1 - s.metallic) / kFloatPi;
  const Vec3<F> f0 = f0_of(s);
  Vec3<F> out;
  for (int k = 0; k < 3; ++k) {
    const F fresnel = f0[k] + (1 - f0[k]) * lighting.schlick;
    const F reflected =
        (s.base_colour[k] * lambert * (1 - fresnel) + fresnel * lighting.mirrored) * lighting.n_dot_l;
    out[k] = lighting.n_dot_l > 0 ? reflected : 0.f;
  }
  return out;
}

/// Light from all around, with what a second and later reflection between microfacets adds (Fdez-Aguera
/// 2019).
template <Float F>
Vec3<F> reflected_surroundings(const SurfaceOf<F>& s, const LightingOf<F>& lighting) {
  const Vec3<F> f0 = f0_of(s);
  const Vec2<F> ab = lighting.split;
  Vec3<F> single, multiple;
  const F lost = 1 - (ab.x + ab.y);
  for (int k = 0; k < 3; ++k) {
    single[k] = f0[k] * ab.x + ab.y;
    const F average = f0[k] + (1 - f0[k]) * (1.f / 21);
    multiple[k] = single[k] * average / (1 - lost * average) * lost;
  }
  const F left = 1 - largest(single + multiple);
  const Vec3<F> light = lighting.diffuse;
  const Vec3<F> diffuse = product(s.base_colour, light) * ((1 - s.metallic) * left * s.occlusion);
  const F occluded = any(s.occlusion != lighting.occlusion)
                         ? specular_occlusion(lighting.n_dot_v, s.occlusion, s.roughness)
                         : lighting.occluded;
  return diffuse + (product(lighting.glossy, single) + product(light, multiple)) * occluded;
}

/// Reflected radiance for one direction of light, per irradiance on a surface that faces it: BRDF x (n.l).
template <Float F>
Vec3<F> reflected_by_brdf(const SurfaceOf<F>& surface, Vec3f to_light, Vec3<F> to_viewer) {
  LightingOf<F> lighting;
  add_key(surface, to_light, to_viewer, lighting);
  return reflected_from_key(surface, lighting);
}

/// `same_normal`, where there is one, has been found with the same normal.
template <Float F>
LightingOf<F> lighting_of(const SurfaceOf<F>& s, Vec3<F> to_viewer, const RenderEnvironment& environment,
                          const LightingOf<F>* same_normal = nullptr) {
  LightingOf<F> out;
  add_key(s, environment.key.towards, to_viewer, out);
  const F cosine = dot(s.normal, to_viewer);
  out.n_dot_v = saturated(cosine);
  out.split = split_sum(s.roughness, out.n_dot_v);
  out.diffuse = same_normal ? same_normal->diffuse : diffuse_light(environment, s.normal);
  if (!environment.levels.empty()) {
    // A rough lobe's mean direction leans towards the normal.
    const Vec3<F> mirror = s.normal * (2 * cosine) - to_viewer;
    const Vec3<F> direction = normalized(mixed(mirror, s.normal, s.roughness * s.roughness));
    out.glossy = specular_light(environment, direction, s.roughness);
  }
  out.occlusion = s.occlusion;
  out.occluded = specular_occlusion(out.n_dot_v, s.occlusion, s.roughness);
  return out;
}

/// Radiance that leaves a surface towards the viewer: the key light, the environment and emission.
template <Float F>
Vec3<F> radiance_of(const SurfaceOf<F>& s, const LightingOf<F>& lighting,
                    const RenderEnvironment& environment) {
  return product(reflected_from_key(s, lighting), each<F>(environment.key.irradiance)) +
         reflected_surroundings(s, lighting) + s.emission;
}

/// tone_mapped() of shade.h.
template <Float F>
Vec3<F> tone_mapped_of(Vec3<F> linear) {
  constexpr float kStart = 0.8f - 0.04f, kDesaturation = 0.15f, kRoom = 1 - kStart;
  Vec3<F> c;
  for (int k = 0; k < 3; ++k) c[k] = clamped(linear[k], 0, 65504);
  const F xy = c.x < c.y ? c.x : c.y, least = xy < c.z ? xy : c.z;
  const F offset = least < 0.08f ? least - 6.25f * least * least : 0.04f;
  c = c - Vec3<F>{offset, offset, offset};
  const F peak = largest(c);
  if (any(peak >= kStart)) {
    const F new_peak = 1 - kRoom * kRoom / (peak + kRoom - kStart);
    const F grey = 1 - 1 / (kDesaturation * (peak - new_peak) + 1);
    for (int k = 0; k < 3; ++k) {
      const F darker = c[k] * (new_peak / peak);
      c[k] = peak >= kStart ? darker + (new_peak - darker) * grey : c[k];
    }
  }
  return {saturated(c.x), saturated(c.y), saturated(c.z)};
}

}  // namespace texmesh
