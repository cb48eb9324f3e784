#include "stages/render/fragment_shader.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "stages/render/shade.h"

namespace texmesh::render {
namespace {

constexpr float kNone = 1e-20f;  // squares below this are no length

Vec3f xyz(Vec4f v) { return {v.x, v.y, v.z}; }

bool same_read(const TextureSlot& a, const TextureSlot& b) {
  return a.texture == b.texture && a.uv_set == b.uv_set && a.wrap_s == b.wrap_s && a.wrap_t == b.wrap_t &&
         a.mag_filter == b.mag_filter && a.min_filter == b.min_filter && a.transform == b.transform;
}

}  // namespace

FragmentShader::FragmentShader(const RenderScene& scene, const Visibility& visibility,
                               const std::vector<RenderTexture>& textures,
                               const RenderEnvironment& environment)
    : scene_(scene),
      camera_(visibility.camera),
      environment_(environment),
      frame_(visibility.camera, visibility.side_px),
      side_px_(visibility.side_px) {
  for (const RenderMaterial& material : *scene.materials) {
    Prepared prepared;
    prepared.material = &material;
    for (std::size_t use = 0; use < kTextureUses; ++use)
      prepared.slots[use] = prepared_slot(material.textures[use], textures);
    prepared.occlusion_with_roughness =
        same_read(material.slot(TextureUse::kOcclusion), material.slot(TextureUse::kMetallicRoughness));
    materials_.push_back(prepared);
  }
}

FragmentShader::Slot FragmentShader::prepared_slot(const TextureSlot& use,
                                                   const std::vector<RenderTexture>& textures) const {
  Slot slot;
  const std::vector<Vec2f>& uv = use.uv_set == 1 ? scene_.mesh->uv1 : scene_.mesh->uv0;
  if (use.texture < 0) return slot;
  if (static_cast<std::size_t>(use.texture) >= textures.size())
    throw std::invalid_argument("shade: a material's texture is not there");
  const RenderTexture& texture = textures[static_cast<std::size_t>(use.texture)];
  if (texture.levels.empty() || uv.empty()) return slot;
  return {&texture, &use, &uv, uv_matrix(use.transform)};
}

FragmentPlace FragmentShader::place_of(std::uint32_t pixel, const RenderFragment& fragment) const {
  FragmentPlace out;
  out.corner = (*scene_.triangles)[fragment.triangle];
  out.weight = {1 - fragment.weight1 - fragment.weight2, fragment.weight1, fragment.weight2};
  const Mesh& mesh = *scene_.mesh;
  std::array<Vec3d, 3> seen;
  Vec3d position[3];
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec3f p = mesh.positions[mesh.wedge_position[out.corner[k]]];
    position[k] = to_double(p);
    seen[k] = seen_from(camera_, frame_, p);
  }
  out.edge1 = position[1] - position[0];
  out.edge2 = position[2] - position[0];
  out.face = to_float(normalized(cross(out.edge1, out.edge2)));

  const Vec2d mean = mean_of_samples(fragment.mask);
  const double x = (pixel % side_px_) * kSamplesPerSide + mean.x + 0.5 - frame_.half,
               y = (pixel / side_px_) * kSamplesPerSide + mean.y + 0.5 - frame_.half;
  const double right = x * frame_.pitch, down = y * frame_.pitch;
  out.to_viewer = to_float(normalized(camera_.z + camera_.y * down - camera_.x * right));

  const EdgePlanes planes = edge_planes(seen);
  double sum = 0, a = 0, b = 0;
  for (const Plane& e : planes.edge) sum += e.at(x, y), a += e.a, b += e.b;
  const double step = kSamplesPerSide / sum;
  if (!std::isfinite(step)) return out;
  auto change = [&](std::size_t k) {
    const double w = static_cast<double>(out.weight[k]);
    return Vec2d{(planes.edge[k].a - w * a) * step, (planes.edge[k].b - w * b) * step};
  };
  const Vec2d one = change(1), two = change(2);
  out.weight_dx = {static_cast<float>(one.x), static_cast<float>(two.x)};
  out.weight_dy = {static_cast<float>(one.y), static_cast<float>(two.y)};
  return out;
}

Vec4f FragmentShader::read(const Slot& slot, const FragmentPlace& place) const {
  const std::vector<Vec2f>& uv = *slot.uv;
  const Vec2f first = uv[place.corner[0]];
  const Vec2f along1 = uv[place.corner[1]] - first, along2 = uv[place.corner[2]] - first;
  TextureFootprint footprint;
  footprint.uv = slot.matrix.place(first + along1 * place.weight[1] + along2 * place.weight[2]);
  footprint.uv_dx = slot.matrix.direction(along1 * place.weight_dx.x + along2 * place.weight_dx.y);
  footprint.uv_dy = slot.matrix.direction(along1 * place.weight_dy.x + along2 * place.weight_dy.y);
  return read_texture(*slot.texture, *slot.use, footprint);
}

Vec4f FragmentShader::base_colour(const Prepared& prepared, const FragmentPlace& place) const {
  Vec4f c = prepared.material->base_colour;
  auto multiply = [&c](Vec4f by) { c = {c.x * by.x, c.y * by.y, c.z * by.z, c.w * by.w}; };
  const Slot& slot = prepared.slot(TextureUse::kBaseColour);
  if (slot.texture) multiply(read(slot, place));
  const std::vector<Vec4f>& colours = scene_.mesh->colours;
  if (!colours.empty()) {
    const Vec4f a = colours[place.corner[0]], b = colours[place.corner[1]], d = colours[place.corner[2]];
    auto mean = [&](float x, float y, float z) {
      return x + (y - x) * place.weight[1] + (z - x) * place.weight[2];
    };
    multiply({mean(a.x, b.x, d.x), mean(a.y, b.y, d.y), mean(a.z, b.z, d.z), mean(a.w, b.w, d.w)});
  }
  return {saturated(c.x), saturated(c.y), saturated(c.z), saturated(c.w)};
}

// The unit normal between those of the wedges, and how much it turns within a pixel: the largest change of
// one of its coordinates before the camera.
Vec3f FragmentShader::interpolated_normal(const FragmentPlace& place, float& roughness) const {
  roughness = 0;
  const std::vector<Vec3f>& normals = scene_.mesh->normals;
  if (normals.empty()) return place.face;
  const Vec3f sum = place.mean(normals);
  const float square = dot(sum, sum);
  if (!(square > kNone && square < 1e20f)) return place.face;
  const float inverse = 1 / std::sqrt(square);
  const Vec3f normal = sum * inverse;
  const Vec3f along1 = normals[place.corner[1]] - normals[place.corner[0]],
              along2 = normals[place.corner[2]] - normals[place.corner[0]];
  for (const Vec2f step : {place.weight_dx, place.weight_dy}) {
    const Vec3f change = along1 * step.x + along2 * step.y;
    const Vec3f turn = (change - normal * dot(normal, change)) * inverse;
    for (const Vec3d& axis : {camera_.x, camera_.y, camera_.z}) {
      const float part = std::fabs(dot(turn, to_float(axis)));
      if (part > roughness) roughness = part;
    }
  }
  return normal;
}

// False when a corner has no tangent.
bool FragmentShader::vertex_frame(const FragmentPlace& place, Vec3f frame[2]) const {
  const Mesh& mesh = *scene_.mesh;
  if (mesh.tangents.empty()) return false;
  frame[0] = frame[1] = {};
  for (std::size_t k = 0; k < 3; ++k) {
    const Vec4f tangent = mesh.tangents[place.corner[k]];
    const Vec3f direction = normalized(xyz(tangent));
    if (!(dot(direction, direction) > 0.5f)) return false;
    const Vec3f normal = mesh.normals.empty() ? place.face : mesh.normals[place.corner[k]];
    frame[0] = frame[0] + direction * place.weight[k];
    frame[1] = frame[1] + normalized(cross(normal, direction) * tangent.w) * place.weight[k];
  }
  frame[0] = normalized(frame[0]);
  frame[1] = normalized(frame[1]);
  return true;
}

// Across the texture's axes on the triangle, seen from the normal (Schueler 2013). glTF's maps have +Y up
// where its coordinates grow downwards. Without an area of the texture the frame is zero, and the map has no
// effect.
void FragmentShader::derivative_frame(const Slot& slot, const FragmentPlace& place, Vec3f normal,
                                      Vec3f frame[2]) const {
  const std::vector<Vec2f>& uv = *slot.uv;
  const Vec2f first = uv[place.corner[0]];
  const Vec2d along1 = to_double(slot.matrix.direction(uv[place.corner[1]] - first)),
              along2 = to_double(slot.matrix.direction(uv[place.corner[2]] - first));
  const Vec3d n = to_double(normal);
  const Vec3d u = cross(n, place.edge1 * along2.x - place.edge2 * along1.x);
  const Vec3d v = cross(n, place.edge2 * along1.y - place.edge1 * along2.y);
  const double square = std::max(dot(u, u), dot(v, v));
  const double scale = square > 0 && std::isfinite(square) ? 1 / std::sqrt(square) : 0;
  frame[0] = to_float(u * scale);
  frame[1] = to_float(v * scale);
}

Vec3f FragmentShader::mapped_normal(const Prepared& prepared, const FragmentPlace& place,
                                    Vec3f normal) const {
  const Slot& slot = prepared.slot(TextureUse::kNormal);
  if (!slot.texture) return normal;
  const Vec4f texel = read(slot, place);
  const float scale = prepared.material->normal_scale;
  Vec3f frame[2];
  if (!vertex_frame(place, frame)) derivative_frame(slot, place, normal, frame);
  const Vec3f sum = frame[0] * ((texel.x * 2 - 1) * scale) + frame[1] * ((texel.y * 2 - 1) * scale) +
                    normal * (texel.z * 2 - 1);
  const float square = dot(sum, sum);
  return square > kNone && square < 1e20f ? sum * (1 / std::sqrt(square)) : normal;
}

Surface FragmentShader::surface_of(const Prepared& prepared, const FragmentPlace& place, Vec4f base,
                                   bool back) const {
  const RenderMaterial& material = *prepared.material;
  Surface out;
  out.base_colour = xyz(base);
  float geometry_roughness = 0;
  const Vec3f normal = interpolated_normal(place, geometry_roughness);
  out.normal = mapped_normal(prepared, place, normal) * (back ? -1.f : 1.f);
  out.metallic = material.metallic;
  out.roughness = material.roughness;
  float occlusion = 1;
  if (const Slot& slot = prepared.slot(TextureUse::kMetallicRoughness); slot.texture) {
    const Vec4f texel = read(slot, place);
    out.roughness *= texel.y;
    out.metallic *= texel.z;
    if (prepared.occlusion_with_roughness) occlusion = texel.x;
  }
  if (const Slot& slot = prepared.slot(TextureUse::kOcclusion);
      slot.texture && !prepared.occlusion_with_roughness)
    occlusion = read(slot, place).x;
  out.occlusion = saturated(1 + (occlusion - 1) * material.occlusion_strength);
  out.roughness = clamped(out.roughness, kLeastRoughness, 1) + geometry_roughness;
  if (!(out.roughness < 1)) out.roughness = 1;
  out.emission = material.emissive;
  if (const Slot& slot = prepared.slot(TextureUse::kEmissive); slot.texture && largest(out.emission) > 0)
    out.emission = product(out.emission, xyz(read(slot, place)));
  return out;
}

FragmentColour FragmentShader::colour_of(std::uint32_t pixel, const RenderFragment& fragment) const {
  const RenderMaterial& material = scene_.material_of(fragment.triangle);
  const Prepared& prepared = materials_[static_cast<std::size_t>(&material - scene_.materials->data())];
  const FragmentPlace place = place_of(pixel, fragment);
  const Vec4f base = base_colour(prepared, place);
  FragmentColour out;
  out.alpha = 1;
  if (material.alpha_mode == AlphaMode::kMask && base.w < material.alpha_cutoff) return {};
  if (material.alpha_mode == AlphaMode::kBlend) out.alpha = base.w;
  if (out.alpha == 0) return {};
  if (material.unlit) {
    out.linear = tone_mapped(xyz(base));
    return out;
  }
  const Surface surface = surface_of(prepared, place, base, fragment.back != 0);
  out.linear = tone_mapped(radiance_towards(surface, place.to_viewer, environment_));
  return out;
}

}  // namespace texmesh::render
