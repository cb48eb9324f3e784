#pragma once
// Inside the room only: how a surface reflects light (glTF 2.0, appendix B), and the colours of a triangle
// within a pixel.
#include <optional>

#include "stages/render/environment.h"
#include "stages/render/render_math.h"
#include "stages/render/render_texture.h"
#include "stages/render/visibility_tile.h"

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
/// Radiance that leaves a surface towards the viewer: the key light, the environment and emission.
Vec3f radiance_of(const LitSurface& surface, const Lighting& lighting, const RenderEnvironment& environment);

/// What all fragments of a triangle have in common.
struct TriangleInView {
  Triangle corner{};   // wedges
  Vec3d edge1, edge2;  // from corner 0, object units
  Vec3f face;          // unit normal of the triangle's front
  EdgePlanes planes;
};

/// What is known of a fragment's place before its material is read. The triangle must outlive it.
struct FragmentPlace {
  const TriangleInView& triangle;
  std::array<float, 3> weight{};  // of the corners
  // Change of the weights of corners 1 and 2 by a pixel to the right, and downwards.
  Vec2f weight_dx, weight_dy;
  Vec3f to_viewer;  // unit

  /// Interpolates values of the wedges.
  template <class T>
  T mean(const std::vector<T>& of_wedges) const {
    const Triangle& corner = triangle.corner;
    const T a = of_wedges[corner[0]];
    return a + (of_wedges[corner[1]] - a) * weight[1] + (of_wedges[corner[2]] - a) * weight[2];
  }
};

struct FragmentColour {
  Vec3f linear;     // tone-mapped, 0..1
  float alpha = 0;  // 0 = nothing is there
};

/// Lists of materials that differ in the textures of their slots alone.
using MaterialVariants = std::span<const std::vector<RenderMaterial>* const>;

/// Shades the fragments of one view with every variant of the materials. What variants have in common is
/// worked out once.
class FragmentShader {
 public:
  /// All must outlive the shader. std::invalid_argument when a material names a texture that is not there,
  /// and for variants that differ in more than textures.
  FragmentShader(const RenderScene& scene, const Visibility& visibility, MaterialVariants variants,
                 const std::vector<RenderTexture>& textures, const RenderEnvironment& environment);

  /// Memory of one thread.
  struct Scratch {
    std::vector<TextureSite> sites;
    std::vector<std::uint8_t> known;  // per site
    /// By index modulo kTriangles: a triangle comes back in the next row of pixels.
    static constexpr std::size_t kTriangles = 64;
    struct Seen {
      std::uint32_t index = kNoIndex;
      TriangleInView in_view;
    };
    std::vector<Seen> triangles = std::vector<Seen>(kTriangles);
  };
  /// One colour per variant.
  void colours_of(std::uint32_t pixel, const RenderFragment& fragment, Scratch& scratch,
                  std::span<FragmentColour> out) const;

 private:
  /// Where some slots of a material read textures of one size.
  struct Site {
    const TextureSlot* use = nullptr;
    Vec2<std::uint32_t> size_px;
    std::uint32_t first_level = 0;
    const std::vector<Vec2f>* uv = nullptr;
    UvMatrix matrix;
  };
  struct Read {
    const RenderTexture* texture = nullptr;  // null: white, or flat
    std::size_t site = 0;
    friend bool operator==(const Read&, const Read&) = default;
  };
  using Reads = std::array<Read, kTextureUses>;
  struct Prepared {
    const RenderMaterial* material = nullptr;
    std::vector<Site> sites;
    std::vector<Reads> variants;
  };
  class Fragment;

  Prepared prepared_material(std::size_t index, MaterialVariants variants,
                             const std::vector<RenderTexture>& textures) const;
  Read prepared_read(const TextureSlot& use, const std::vector<RenderTexture>& textures,
                     std::vector<Site>& sites) const;
  TriangleInView triangle_in_view(std::uint32_t triangle) const;
  FragmentPlace place_of(std::uint32_t pixel, const RenderFragment& fragment,
                         const TriangleInView& triangle) const;
  Vec4f vertex_colour(const FragmentPlace& place) const;
  Vec3f interpolated_normal(const FragmentPlace& place, float& roughness) const;
  bool vertex_frame(const FragmentPlace& place, Vec3f frame[2]) const;
  void derivative_frame(const Site& site, const FragmentPlace& place, Vec3f normal, Vec3f frame[2]) const;

  const RenderScene& scene_;
  const RenderCamera& camera_;
  std::array<Vec3f, 3> axes_;  // the camera's
  const RenderEnvironment& environment_;
  SampleFrame frame_;
  std::uint32_t side_px_;
  std::vector<Prepared> materials_;
};

}  // namespace texmesh
