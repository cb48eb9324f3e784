#pragma once
// Inside the room only: the colour of a triangle within a pixel.
#include <array>
#include <vector>

#include "stages/render/brdf.h"
#include "stages/render/edge_planes.h"
#include "stages/render/render_texture.h"

namespace texmesh::render {

/// What is known of a fragment's place before its material is read.
struct FragmentPlace {
  Triangle corner{};              // wedges
  std::array<float, 3> weight{};  // of the corners
  // Change of the weights of corners 1 and 2 by a pixel to the right, and downwards.
  Vec2f weight_dx, weight_dy;
  Vec3d edge1, edge2;  // from corner 0, object units
  Vec3f face;          // unit normal of the triangle's front
  Vec3f to_viewer;     // unit

  /// Interpolates values of the wedges.
  template <class T>
  T mean(const std::vector<T>& of_wedges) const {
    const T a = of_wedges[corner[0]];
    return a + (of_wedges[corner[1]] - a) * weight[1] + (of_wedges[corner[2]] - a) * weight[2];
  }
};

struct FragmentColour {
  Vec3f linear;     // tone-mapped, 0..1
  float alpha = 0;  // 0 = nothing is there
};

/// Shades the fragments of one picture.
class FragmentShader {
 public:
  /// All must outlive the shader. std::invalid_argument when a material names a texture that is not there.
  FragmentShader(const RenderScene& scene, const Visibility& visibility,
                 const std::vector<RenderTexture>& textures, const RenderEnvironment& environment);
  FragmentColour colour_of(std::uint32_t pixel, const RenderFragment& fragment) const;

 private:
  struct Slot {
    const RenderTexture* texture = nullptr;  // null: white, or flat
    const TextureSlot* use = nullptr;
    const std::vector<Vec2f>* uv = nullptr;
    UvMatrix matrix;
  };
  struct Prepared {
    const RenderMaterial* material = nullptr;
    std::array<Slot, kTextureUses> slots;
    bool occlusion_with_roughness = false;  // one read serves both
    const Slot& slot(TextureUse use) const { return slots[static_cast<std::size_t>(use)]; }
  };
  Slot prepared_slot(const TextureSlot& use, const std::vector<RenderTexture>& textures) const;
  FragmentPlace place_of(std::uint32_t pixel, const RenderFragment& fragment) const;
  Vec4f read(const Slot& slot, const FragmentPlace& place) const;
  Vec4f base_colour(const Prepared& prepared, const FragmentPlace& place) const;
  Surface surface_of(const Prepared& prepared, const FragmentPlace& place, Vec4f base, bool back) const;
  Vec3f interpolated_normal(const FragmentPlace& place, float& roughness) const;
  Vec3f mapped_normal(const Prepared& prepared, const FragmentPlace& place, Vec3f normal) const;
  bool vertex_frame(const FragmentPlace& place, Vec3f frame[2]) const;
  void derivative_frame(const Slot& slot, const FragmentPlace& place, Vec3f normal, Vec3f frame[2]) const;

  const RenderScene& scene_;
  const RenderCamera& camera_;
  const RenderEnvironment& environment_;
  SampleFrame frame_;
  std::uint32_t side_px_;
  std::vector<Prepared> materials_;
};

}  // namespace texmesh::render
