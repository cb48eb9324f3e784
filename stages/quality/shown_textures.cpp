#include "stages/quality/shown_textures.h"

#include <algorithm>
#include <cmath>

namespace texmesh::quality {
namespace {

/// The full-size plane of an image; `alpha` = that of its alpha channel.
std::optional<std::uint32_t> plane_of(const Fragments& fragments, std::int32_t image, bool alpha) {
  for (std::uint32_t p = 0; p < fragments.planes.size(); ++p) {
    const TexturePlane& plane = fragments.planes[p];
    if (plane.image == static_cast<std::uint32_t>(image) && plane.mip == 0 &&
        (plane.role == TextureRole::kAlpha) == alpha)
      return p;
  }
  return std::nullopt;
}

bool shows(const Material& material, TextureUse use) {
  if (material.unlit) return use == TextureUse::kBaseColour;
  const Vec3f e = material.emissive;
  return use != TextureUse::kEmissive || e.x > 0 || e.y > 0 || e.z > 0;
}

/// Twice the area of a triangle in pixels; 0 = no such thing.
double area_in_picture(const RenderScene& scene, const Visibility& view, const Triangle& triangle) {
  const RenderCamera& camera = view.camera;
  const double scale = 0.5 * view.side_px / camera.tan_half_fov;
  Vec2d at[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3d d = to_double(scene.mesh->positions[scene.mesh->wedge_position[triangle[k]]]) - camera.eye;
    const double away = -dot(d, camera.z);
    if (!(away > camera.near)) return 0;
    at[k] = {dot(d, camera.x) / away * scale, dot(d, camera.y) / away * scale};
  }
  const Vec2d a = at[1] - at[0], b = at[2] - at[0];
  return std::fabs(a.x * b.y - a.y * b.x);
}

/// Twice the area of a triangle in a texture of that size, in its texels.
double area_in_texture(const Mesh& mesh, const TextureSlot& slot, const Triangle& triangle,
                       Vec2<std::uint32_t> size) {
  const std::vector<Vec2f>& uv = slot.uv_set == 1 ? mesh.uv1 : mesh.uv0;
  if (uv.empty()) return 0;
  const Vec2f a = uv[triangle[1]] - uv[triangle[0]], b = uv[triangle[2]] - uv[triangle[0]];
  const Vec2f s = slot.transform.scale;
  return std::fabs((static_cast<double>(a.x) * static_cast<double>(b.y) -
                    static_cast<double>(a.y) * static_cast<double>(b.x)) *
                   static_cast<double>(s.x) * static_cast<double>(s.y) * size.x * size.y);
}

}  // namespace

ShownTextures find_shown(const std::vector<Material>& materials, const Fragments& fragments,
                         const Mesh& mesh) {
  ShownTextures shown;
  auto texture_of = [&](const TextureRef& ref, bool srgb) -> std::int32_t {
    const std::vector<Vec2f>& uv = ref.texcoord == 0 ? mesh.uv0 : mesh.uv1;
    const auto plane = plane_of(fragments, ref.image, false);
    if (ref.texcoord > 1 || uv.empty() || !plane) return -1;
    for (std::size_t t = 0; t < shown.textures.size(); ++t)
      if (shown.textures[t].plane == *plane && shown.textures[t].srgb == srgb)
        return static_cast<std::int32_t>(t);
    shown.textures.push_back({*plane, plane_of(fragments, ref.image, true), srgb, true});
    return static_cast<std::int32_t>(shown.textures.size() - 1);
  };
  for (const Material& m : materials)
    shown.materials.push_back(render_material(m, [&](const TextureRef& ref, TextureUse use) {
      return shows(m, use) ? texture_of(ref, is_srgb(use)) : -1;
    }));
  shown.sampled = shown.materials;
  // Of scales, small pictures stand for larger ones, in which a sampler without mips would not have to
  // flicker.
  for (RenderMaterial& m : shown.materials)
    for (TextureSlot& slot : m.textures) {
      if (slot.texture >= 0 && slot.min_filter != MinFilter::kTrilinear)
        shown.textures[static_cast<std::size_t>(slot.texture)].with_mips = false;
      slot.min_filter = MinFilter::kTrilinear;
    }
  return shown;
}

// By areas: the renderer goes by the longer side of a pixel's footprint, so it never asks for a finer mip.
void LevelCount::add(const RenderScene& scene, const Visibility& view,
                     const std::vector<Vec2<std::uint32_t>>& sizes, double magnification) {
  for (const RenderFragment& fragment : view.fragments) {
    const Triangle& triangle = (*scene.triangles)[fragment.triangle];
    const double pixels = area_in_picture(scene, view, triangle) * magnification * magnification;
    if (!(pixels > 0)) continue;
    for (const TextureSlot& slot : scene.material_of(fragment.triangle).textures) {
      if (slot.texture < 0) continue;
      const auto t = static_cast<std::size_t>(slot.texture);
      const double texels = area_in_texture(*scene.mesh, slot, triangle, sizes[t]);
      std::size_t level = 0;
      for (double limit = 4 * pixels; texels >= limit && level < kMaxFirstLevel; limit *= 4) ++level;
      ++wanted_[t][level];
    }
  }
}

std::vector<std::uint32_t> LevelCount::first_levels() const {
  std::vector<std::uint32_t> first(wanted_.size(), 0);
  for (std::size_t t = 0; t < first.size(); ++t) {
    std::uint64_t total = 0, finer = 0;
    for (const std::uint64_t n : wanted_[t]) total += n;
    for (; first[t] < kMaxFirstLevel; ++first[t]) {
      finer += wanted_[t][first[t]];
      if (50 * finer > total) break;
    }
  }
  return first;
}

}  // namespace texmesh::quality
