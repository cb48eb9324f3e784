#include "stages/proxies/bake/bake.h"

#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr double kCage = 0.03;       // of the diagonal, to both sides
constexpr double kSameSide = 0.15;   // cosine: walls at right angles are no match
constexpr float kNoLength = 1e-20f;  // squares below this are no length

template <class T>
T mean_of(const std::vector<T>& of_wedges, const Triangle& corner, const std::array<double, 3>& weight) {
  return of_wedges[corner[0]] * static_cast<float>(weight[0]) +
         of_wedges[corner[1]] * static_cast<float>(weight[1]) +
         of_wedges[corner[2]] * static_cast<float>(weight[2]);
}

Vec3f unit_or(Vec3f v, Vec3f otherwise) {
  const float square = dot(v, v);
  return square > kNoLength && square < 1e20f ? v * (1 / std::sqrt(square)) : otherwise;
}

float within_unit(float x) { return x > 0 ? (x < 1 ? x : 1) : 0; }

Vec3d area_normal(const std::array<Vec3d, 3>& c) { return cross(c[1] - c[0], c[2] - c[0]); }

}  // namespace

MaterialGroup group_of(const RenderMaterial& material) {
  return {material.unlit, material.double_sided, material.alpha_mode};
}

MaterialGroups find_groups(const Mesh& mesh, const std::vector<RenderMaterial>& materials) {
  MaterialGroups out;
  std::vector<MaterialGroup> of_material;
  for (const RenderMaterial& m : materials) of_material.push_back(group_of(m));
  std::vector<std::uint8_t> used(materials.size(), 0);
  for (const std::uint16_t m : mesh.triangle_material) used[m] = 1;
  for (std::size_t m = 0; m < materials.size(); ++m)
    if (used[m]) out.groups.push_back(of_material[m]);
  std::sort(out.groups.begin(), out.groups.end());
  out.groups.erase(std::unique(out.groups.begin(), out.groups.end()), out.groups.end());
  std::vector<std::uint32_t> index(materials.size(), 0);
  for (std::size_t m = 0; m < materials.size(); ++m)
    index[m] = static_cast<std::uint32_t>(
        std::lower_bound(out.groups.begin(), out.groups.end(), of_material[m]) - out.groups.begin());
  for (const std::uint16_t m : mesh.triangle_material) out.triangle_group.push_back(index[m]);
  return out;
}

BakeSource::BakeSource(const Mesh& mesh, const ShownMaterials& shown, const MaterialGroups& groups)
    : mesh_(mesh),
      shown_(shown),
      groups_(groups.groups.size()),
      tree_index_(mesh.triangles.size(), kNoIndex) {
  std::vector<Vec3d> points;
  Box3d box;
  for (const Vec3f p : mesh.positions) points.push_back(to_double(p));
  std::vector<std::vector<Triangle>> positions(groups_.size());
  for (std::uint32_t i = 0; i < mesh.triangles.size(); ++i) {
    const std::array<Vec3d, 3> c = corner_points(mesh, mesh.triangles[i]);
    for (const Vec3d& p : c) box.extend(p);
    const Vec3d n = area_normal(c);
    if (!(dot(n, n) > 0)) continue;
    const std::uint32_t g = groups.triangle_group[i];
    tree_index_[i] = static_cast<std::uint32_t>(groups_[g].triangles.size());
    groups_[g].triangles.push_back(i);
    positions[g].push_back({mesh.position_of(i, 0), mesh.position_of(i, 1), mesh.position_of(i, 2)});
  }
  for (std::size_t g = 0; g < groups_.size(); ++g)
    if (!positions[g].empty()) groups_[g].tree = std::make_unique<TriangleTree>(points, positions[g]);
  if (!mesh.triangles.empty()) diagonal_ = length(box.max - box.min);
}

std::optional<SurfacePlace> BakeSource::find(std::uint32_t group, Vec3d p, Vec3d normal,
                                             const std::optional<SurfacePlace>& guess) const {
  const Group& g = groups_[group];
  if (!g.tree) return std::nullopt;
  const TriangleTree::Facing facing{normal, kSameSide};
  std::optional<std::uint32_t> try_first;
  if (guess) try_first = tree_index_[guess->triangle];
  auto found = g.tree->crossing(p, normal, kCage * diagonal_, facing, try_first);
  if (!found) found = g.tree->nearest_facing(p, facing);
  if (!found) found = g.tree->nearest(p);
  return SurfacePlace{g.triangles[found->triangle], found->weight};
}

/// Reads textures in one place. Those that are alike but for their texels share where they are read.
class BakeSource::Reader {
 public:
  Reader(const BakeSource& source, const SurfacePlace& place, double footprint)
      : source_(source), place_(place), footprint_(footprint) {}
  const SurfacePlace& place() const { return place_; }

  Vec4f read(const TextureSlot& slot) {
    const RenderTexture& texture = source_.shown_.textures[static_cast<std::size_t>(slot.texture)];
    if (!slot_ || !slot_->is_placed_like(slot) || texture.width_px != like_->width_px ||
        texture.height_px != like_->height_px || texture.first_level != like_->first_level) {
      site_ = TextureSite({texture.width_px, texture.height_px}, texture.first_level, slot,
                          footprint_of(slot, texture));
      slot_ = &slot, like_ = &texture;
    }
    return site_.read(texture);
  }

 private:
  TextureFootprint footprint_of(const TextureSlot& slot, const RenderTexture& texture) const {
    const Mesh& mesh = source_.mesh_;
    const Triangle& corner = mesh.triangles[place_.triangle];
    const std::vector<Vec2f>& uv = slot.uv_set == 1 ? mesh.uv1 : mesh.uv0;
    const UvMatrix matrix = uv_matrix(slot.transform);
    TextureFootprint at;
    at.uv = matrix.place(mean_of(uv, corner, place_.weight));
    const Vec2d along1 = to_double(matrix.direction(uv[corner[1]] - uv[corner[0]])),
                along2 = to_double(matrix.direction(uv[corner[2]] - uv[corner[0]]));
    const double texels = std::fabs(cross(along1, along2)) * texture.width_px * texture.height_px;
    const double area = length(area_normal(corner_points(mesh, corner)));
    const double side = footprint_ * std::sqrt(texels / area);  // of the footprint in texels
    if (std::isfinite(side)) {
      at.uv_dx = {static_cast<float>(side / texture.width_px), 0};
      at.uv_dy = {0, static_cast<float>(side / texture.height_px)};
    }
    return at;
  }

  const BakeSource& source_;
  const SurfacePlace& place_;
  const double footprint_;
  const TextureSlot* slot_ = nullptr;    // of the last one read,
  const RenderTexture* like_ = nullptr;  // its texture
  TextureSite site_;                     // and where it was read
};

Vec3f BakeSource::mapped_normal(Reader& reader, const RenderMaterial& material) const {
  const SurfacePlace& place = reader.place();
  const Triangle& corner = mesh_.triangles[place.triangle];
  const std::array<Vec3d, 3> corners = corner_points(mesh_, corner);
  const Vec3f face = to_float(normalized(area_normal(corners)));
  const Vec3f normal =
      mesh_.normals.empty() ? face : unit_or(mean_of(mesh_.normals, corner, place.weight), face);
  const TextureSlot& slot = material.slot(TextureUse::kNormal);
  if (slot.texture < 0) return normal;
  TextureFrame frame;
  if (const auto carried = vertex_frame(mesh_, place.triangle, place.weight)) {
    frame = *carried;
  } else {
    const std::vector<Vec2f>& uv = slot.uv_set == 1 ? mesh_.uv1 : mesh_.uv0;
    const UvMatrix matrix = uv_matrix(slot.transform);
    std::array<Vec2d, 3> at;
    for (std::size_t k = 0; k < 3; ++k) at[k] = to_double(matrix.direction(uv[corner[k]]));
    frame = texture_frame(corners, at, to_double(normal));
  }
  const Vec4f texel = reader.read(slot);
  const float scale = material.normal_scale;
  return unit_or(to_float(frame.along_u) * ((texel.x * 2 - 1) * scale) +
                     to_float(frame.along_v) * ((texel.y * 2 - 1) * scale) + normal * (texel.z * 2 - 1),
                 normal);
}

void BakeSource::add_colours(Reader& reader, const RenderMaterial& m, BakeSample& out) const {
  const SurfacePlace& place = reader.place();
  Vec4f base = m.base_colour;
  const auto multiply = [&base](Vec4f by) {
    base = {base.x * by.x, base.y * by.y, base.z * by.z, base.w * by.w};
  };
  if (const TextureSlot& slot = m.slot(TextureUse::kBaseColour); slot.texture >= 0)
    multiply(reader.read(slot));
  if (!mesh_.colours.empty()) {
    Vec4f sum{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec4f c = mesh_.colours[mesh_.triangles[place.triangle][k]];
      const auto w = static_cast<float>(place.weight[k]);
      sum = {sum.x + c.x * w, sum.y + c.y * w, sum.z + c.z * w, sum.w + c.w * w};
    }
    multiply(sum);
  }
  out.base_colour = {within_unit(base.x), within_unit(base.y), within_unit(base.z)};
  out.alpha = within_unit(base.w);
  if (m.alpha_mode == AlphaMode::kOpaque) out.alpha = 1;
  if (m.alpha_mode == AlphaMode::kMask) out.alpha = out.alpha >= m.alpha_cutoff ? 1 : 0;
  if (m.unlit || m.emissive == Vec3f{}) return;
  out.emission = m.emissive;
  if (const TextureSlot& slot = m.slot(TextureUse::kEmissive); slot.texture >= 0) {
    const Vec4f e = reader.read(slot);
    out.emission = {m.emissive.x * e.x, m.emissive.y * e.y, m.emissive.z * e.z};
  }
}

void BakeSource::add_data(Reader& reader, const RenderMaterial& m, BakeSample& out) const {
  const TextureSlot &rough_metal = m.slot(TextureUse::kMetallicRoughness),
                    &occlusion = m.slot(TextureUse::kOcclusion);
  Vec4f texel{1, 1, 1, 1};
  if (rough_metal.texture >= 0) texel = reader.read(rough_metal);
  out.roughness = within_unit(m.roughness * texel.y);
  out.metallic = within_unit(m.metallic * texel.z);
  if (occlusion.texture < 0) return;
  if (occlusion.texture != rough_metal.texture || !occlusion.is_placed_like(rough_metal))
    texel = reader.read(occlusion);
  out.occlusion = within_unit(1 + (texel.x - 1) * m.occlusion_strength);
}

BakeSample BakeSource::sample(const SurfacePlace& place, double footprint, const SampleParts& parts) const {
  const RenderMaterial& m = shown_.materials[mesh_.triangle_material[place.triangle]];
  BakeSample out;
  Reader reader(*this, place, footprint);
  if (parts.colours) add_colours(reader, m, out);
  if (m.unlit) return out;
  if (parts.data) add_data(reader, m, out);
  if (parts.normal) out.normal = mapped_normal(reader, m);
  return out;
}

}  // namespace texmesh
