#pragma once
// Inside the room only: the colours of triangles within pixels.
#include "stages/render/lighting.h"
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

/// A fragment in its picture.
struct FragmentInPixel {
  std::uint32_t pixel = 0;
  RenderFragment fragment;
};

struct FragmentColour {
  Vec3f linear;     // tone-mapped, 0..1
  float alpha = 0;  // 0 = nothing is there
};

/// Lists of materials that differ in the textures of their slots alone.
using MaterialVariants = std::span<const std::vector<RenderMaterial>* const>;

/// Shades the fragments of one view with every variant of the materials, kLanes of them at a time. What
/// variants have in common is worked out once.
class FragmentShader {
 public:
  /// All must outlive the shader. std::invalid_argument when a material names a texture that is not there,
  /// and for variants that differ in more than textures.
  FragmentShader(const RenderScene& scene, const Visibility& visibility, MaterialVariants variants,
                 const std::vector<RenderTexture>& textures, const RenderEnvironment& environment);

  class Scratch;
  /// [fragment][variant]
  void colours_of(std::span<const FragmentInPixel> fragments, Scratch& scratch,
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
  struct FragmentLanes;
  struct VariantLanes;

  Prepared prepared_material(std::size_t index, MaterialVariants variants,
                             const std::vector<RenderTexture>& textures) const;
  Read prepared_read(const TextureSlot& use, const std::vector<RenderTexture>& textures,
                     std::vector<Site>& sites) const;
  void gather(const FragmentInPixel& fragment, std::size_t lane, Scratch& scratch,
              std::span<FragmentColour> out) const;
  void light(std::size_t lanes, Scratch& scratch, std::span<FragmentColour> out) const;
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

/// What kLanes fragments have in common in all variants.
struct FragmentShader::FragmentLanes {
  Vec3<Lanes> to_viewer;
  Vec3<Lanes> normal;          // between those of the wedges
  Vec3<Lanes> frame[2];        // of normal maps
  Lanes normal_scale{}, side;  // -1 = seen from behind
};
/// What they are with one variant.
struct FragmentShader::VariantLanes {
  SurfaceOf<Lanes> surface;  // its normal comes last
  Vec4<Lanes> normal_texel;  // w < 0: there is no map
  LaneInts is_lit{};         // 0: nothing is there, or its colour is known
};

/// Memory of one thread.
class FragmentShader::Scratch {
  friend FragmentShader;
  std::vector<TextureSite> sites;
  std::vector<std::uint8_t> known;  // per site
  /// By index modulo kTriangles: a triangle comes back in the next row of pixels.
  static constexpr std::size_t kTriangles = 64;
  struct Seen {
    std::uint32_t index = kNoIndex;
    TriangleInView in_view;
  };
  std::vector<Seen> triangles = std::vector<Seen>(kTriangles);
  FragmentLanes lanes;
  std::vector<VariantLanes> variants;
};

}  // namespace texmesh
