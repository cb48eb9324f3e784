#include <cmath>

#include "stages/measure/atlas/atlas_parts.h"

namespace texmesh {
namespace {

/// Base colour's texture; without one, the first that is used.
TextureRef guide_of(const Material& material, const Mesh& mesh, std::span<const AtlasImage> images) {
  TextureRef guide;
  for_each_texture(material, [&](const TextureRef& t) {
    const bool has_uv = t.texcoord == 1 ? !mesh.uv1.empty() : t.texcoord == 0 && !mesh.uv0.empty();
    if (guide.used() || !t.used() || !has_uv) return;
    const auto image = static_cast<std::size_t>(t.image);
    if (image < images.size() && images[image].width_px > 0 && images[image].height_px > 0) guide = t;
  });
  return guide;
}

}  // namespace

AtlasLayout::AtlasLayout(const Mesh& mesh, const std::vector<Material>& materials,
                         std::span<const AtlasImage> images)
    : mesh_(mesh) {
  for (const Material& m : materials) {
    guide_.push_back(guide_of(m, mesh, images));
    const TextureRef& g = guide_.back();
    const AtlasImage image = g.used() ? images[static_cast<std::size_t>(g.image)] : AtlasImage{1, 1, nullptr};
    map_.emplace_back(g.transform, image.width_px, image.height_px);
  }
}

std::array<Vec2d, 3> AtlasLayout::texels(std::uint32_t triangle) const {
  const TexelMap& map = map_[mesh_.triangle_material[triangle]];
  return {map(uv(triangle, 0)), map(uv(triangle, 1)), map(uv(triangle, 2))};
}

std::array<Vec3d, 3> AtlasLayout::points(std::uint32_t triangle) const {
  const auto at = [&](int k) { return to_double(mesh_.positions[mesh_.position_of(triangle, k)]); };
  return {at(0), at(1), at(2)};
}

double doubled_texels(const std::array<Vec2d, 3>& corners) {
  const double twice = cross(corners[1] - corners[0], corners[2] - corners[0]);
  return std::isfinite(twice) ? twice : 0;
}

}  // namespace texmesh
