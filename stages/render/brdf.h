#pragma once
// Inside the room only: how a surface reflects light (glTF 2.0, appendix B).
#include "stages/render/environment.h"
#include "stages/render/render_math.h"

namespace texmesh {

inline constexpr float kLeastRoughness = 0.0525f;  // three.js r170: what its prefiltered maps resolve

/// A point of a surface, lit or not yet. Linear RGB; directions in world axes.
struct LitSurface {
  Vec3f normal{0, 0, 1};  // unit, what a normal map makes of it
  Vec3f base_colour{1, 1, 1}, emission{0, 0, 0};
  float metallic = 0;
  float roughness = 1;  // kLeastRoughness..1
  float occlusion = 1;  // 1 = open to the environment
  friend bool operator==(const LitSurface&, const LitSurface&) = default;
};

/// GGX distribution of half vectors; alpha = roughness^2.
inline float ggx_distribution(float alpha, float n_dot_h) {
  const float a2 = alpha * alpha, d = n_dot_h * n_dot_h * (a2 - 1) + 1;
  return a2 / (kFloatPi * d * d);
}
/// Smith's height-correlated masking and shadowing, over 4 (n.l) (n.v).
inline float smith_visibility(float alpha, float n_dot_l, float n_dot_v) {
  const float a2 = alpha * alpha;
  const float v = n_dot_l * std::sqrt(a2 + (1 - a2) * n_dot_v * n_dot_v),
              l = n_dot_v * std::sqrt(a2 + (1 - a2) * n_dot_l * n_dot_l);
  return 0.5f / (v + l > 1e-6f ? v + l : 1e-6f);
}
/// (1 - cos)^5
inline float schlick_weight(float cosine) {
  const float c = 1 - cosine, c2 = c * c;
  return c2 * c2 * c;
}
/// Scale and bias of F0 in the mean reflectance of a lobe (Karis 2014, a fit of the split sum's table).
Vec2f split_sum(float roughness, float n_dot_v);

/// Reflected radiance for one direction of light, per irradiance on a surface that faces it: BRDF x (n.l).
Vec3f reflected_by_brdf(const LitSurface& surface, Vec3f to_light, Vec3f to_viewer);

/// What reaches a viewer by a surface of that normal and roughness, whatever its colours.
struct Lighting {
  float n_dot_v = 0;
  float n_dot_l = 0;    // of the key light
  float mirrored = 0;   // specular BRDF of the key light, without Fresnel's part
  float schlick = 0;    // weight of the key light
  Vec2f split;          // split_sum
  Vec3f diffuse;        // diffuse_light
  Vec3f glossy;         // specular_light
  float occlusion = 1;  // the surface's
  float occluded = 1;   // what that leaves of glossy light
};
/// `same_normal`, where there is one, has been found with the same normal.
Lighting lighting_of(const LitSurface& surface, Vec3f to_viewer, const RenderEnvironment& environment,
                     const Lighting* same_normal);
/// radiance_towards() with the surface's lighting.
Vec3f radiance_of(const LitSurface& surface, const Lighting& lighting, const RenderEnvironment& environment);

/// Radiance that leaves a surface towards a unit direction: the key light, the environment and emission.
Vec3f radiance_towards(const LitSurface& surface, Vec3f to_viewer, const RenderEnvironment& environment);

}  // namespace texmesh
