#pragma once
// Inside the room only: the colours of a triangle within a pixel.
#include <optional>

#include "stages/render/brdf.h"
#include "stages/render/render_texture.h"
#include "stages/render/visibility_tile.h"

namespace texmesh {

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
    std::vector<std::uint8_t> known;        // per site
    std::optional<std::uint32_t> triangle;  // of the last fragment, which mostly is the next one's, too
    TriangleInView in_view;
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
