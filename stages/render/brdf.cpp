#include "stages/render/brdf.h"

namespace texmesh {
namespace {

Vec3f mixed(Vec3f a, Vec3f b, float part) { return a + (b - a) * part; }
Vec3f f0_of(const LitSurface& s) { return mixed({0.04f, 0.04f, 0.04f}, s.base_colour, s.metallic); }

/// Lagarde and de Rousiers 2014: occlusion of what comes from the direction of the mirror.
float specular_occlusion(float n_dot_v, float occlusion, float roughness) {
  if (!(occlusion < 1)) return 1;
  const float base = n_dot_v + occlusion;
  if (!(base > 0)) return 0;
  const float power = exp2_of(exp2_of(-16 * roughness - 1) * log2_of(base < 1e-30f ? 1e-30f : base));
  return saturated(power - 1 + occlusion);
}

/// Light of a unit of irradiance from one direction.
Vec3f reflected_from_key(const LitSurface& s, const Lighting& lighting) {
  if (lighting.n_dot_l == 0) return {};
  const float lambert = (1 - s.metallic) / kFloatPi;
  const Vec3f f0 = f0_of(s);
  Vec3f out;
  for (int k = 0; k < 3; ++k) {
    const float fresnel = f0[k] + (1 - f0[k]) * lighting.schlick;
    out[k] = (s.base_colour[k] * lambert * (1 - fresnel) + fresnel * lighting.mirrored) * lighting.n_dot_l;
  }
  return out;
}

void add_key(const LitSurface& s, Vec3f to_light, Vec3f to_viewer, Lighting& out) {
  out.n_dot_l = saturated(dot(s.normal, to_light));
  if (out.n_dot_l == 0) return;
  const Vec3f half = normalized(to_light + to_viewer);
  const float n_dot_v = saturated(dot(s.normal, to_viewer)), n_dot_h = saturated(dot(s.normal, half)),
              v_dot_h = saturated(dot(to_viewer, half));
  const float alpha = s.roughness * s.roughness;
  out.mirrored = smith_visibility(alpha, out.n_dot_l, n_dot_v) * ggx_distribution(alpha, n_dot_h);
  out.schlick = schlick_weight(v_dot_h);
}

/// Light from all around, with what a second and later reflection between microfacets adds (Fdez-Aguera
/// 2019).
Vec3f reflected_surroundings(const LitSurface& s, const Lighting& lighting) {
  const Vec3f f0 = f0_of(s);
  const Vec2f ab = lighting.split;
  Vec3f single, multiple;
  const float lost = 1 - (ab.x + ab.y);
  for (int k = 0; k < 3; ++k) {
    single[k] = f0[k] * ab.x + ab.y;
    const float average = f0[k] + (1 - f0[k]) * (1.f / 21);
    multiple[k] = single[k] * average / (1 - lost * average) * lost;
  }
  const float left = 1 - largest(single + multiple);
  const Vec3f light = lighting.diffuse;
  const Vec3f diffuse = product(s.base_colour, light) * ((1 - s.metallic) * left * s.occlusion);
  const Vec3f specular =
      (product(lighting.glossy, single) + product(light, multiple)) *
      (s.occlusion == lighting.occlusion ? lighting.occluded
                                         : specular_occlusion(lighting.n_dot_v, s.occlusion, s.roughness));
  return diffuse + specular;
}

}  // namespace

Vec2f split_sum(float roughness, float n_dot_v) {
  const float x = 1 - roughness, y = 0.0425f - 0.0275f * roughness, z = 1.04f - 0.572f * roughness,
              w = 0.022f * roughness - 0.04f;
  const float squared = x * x, falling = exp2_of(-9.28f * n_dot_v);
  const float a004 = (squared < falling ? squared : falling) * x + y;
  return {z - 1.04f * a004, w + 1.04f * a004};
}

Vec3f reflected_by_brdf(const LitSurface& s, Vec3f to_light, Vec3f to_viewer) {
  Lighting lighting;
  add_key(s, to_light, to_viewer, lighting);
  return reflected_from_key(s, lighting);
}

Lighting lighting_of(const LitSurface& s, Vec3f to_viewer, const RenderEnvironment& environment,
                     const Lighting* same_normal) {
  Lighting out;
  add_key(s, environment.key.towards, to_viewer, out);
  const float cosine = dot(s.normal, to_viewer);
  out.n_dot_v = saturated(cosine);
  out.split = split_sum(s.roughness, out.n_dot_v);
  out.diffuse = same_normal ? same_normal->diffuse : diffuse_light(environment, s.normal);
  // A rough lobe's mean direction leans towards the normal.
  const Vec3f mirror = s.normal * (2 * cosine) - to_viewer;
  const Vec3f direction = normalized(mixed(mirror, s.normal, s.roughness * s.roughness));
  out.glossy = specular_light(environment, direction, s.roughness);
  out.occlusion = s.occlusion;
  out.occluded = specular_occlusion(out.n_dot_v, s.occlusion, s.roughness);
  return out;
}

Vec3f radiance_of(const LitSurface& s, const Lighting& lighting, const RenderEnvironment& environment) {
  return product(reflected_from_key(s, lighting), environment.key.irradiance) +
         reflected_surroundings(s, lighting) + s.emission;
}

Vec3f radiance_towards(const LitSurface& surface, Vec3f to_viewer, const RenderEnvironment& environment) {
  return radiance_of(surface, lighting_of(surface, to_viewer, environment, nullptr), environment);
}

}  // namespace texmesh
