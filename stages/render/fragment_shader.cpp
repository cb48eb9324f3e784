#include "stages/render/fragment_shader.h"

#include "stages/render/shade.h"

namespace texmesh {
namespace {

constexpr float kNone = 1e-20f;  // squares below this are no length

Vec3f xyz(Vec4f v) { return {v.x, v.y, v.z}; }

std::size_t index_of(TextureUse use) { return static_cast<std::size_t>(use); }

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

FragmentShader::FragmentShader(const RenderScene& scene, const Visibility& visibility,
                               MaterialVariants variants, const std::vector<RenderTexture>& textures,
                               const RenderEnvironment& environment)
    : scene_(scene),
      camera_(visibility.camera),
      axes_{to_float(camera_.x), to_float(camera_.y), to_float(camera_.z)},
      environment_(environment),
      frame_(visibility.camera, visibility.side_px),
      side_px_(visibility.side_px) {
  for (const std::vector<RenderMaterial>* materials : variants)
    if (materials->size() != scene.materials->size())
      throw std::invalid_argument("shade: variants have as many materials as the scene");
  for (std::size_t m = 0; m < scene.materials->size(); ++m)
    materials_.push_back(prepared_material(m, variants, textures));
}

FragmentShader::Prepared FragmentShader::prepared_material(std::size_t index, MaterialVariants variants,
                                                           const std::vector<RenderTexture>& textures) const {
  Prepared out;
  out.material = &(*scene_.materials)[index];
  for (const std::vector<RenderMaterial>* materials : variants) {
    Reads& reads = out.variants.emplace_back();
    for (std::size_t use = 0; use < kTextureUses; ++use)
      reads[use] = prepared_read((*materials)[index].textures[use], textures, out.sites);
  }
  return out;
}

FragmentShader::Read FragmentShader::prepared_read(const TextureSlot& use,
                                                   const std::vector<RenderTexture>& textures,
                                                   std::vector<Site>& sites) const {
  const std::vector<Vec2f>& uv = use.uv_set == 1 ? scene_.mesh->uv1 : scene_.mesh->uv0;
  if (use.texture < 0) return {};
  if (static_cast<std::size_t>(use.texture) >= textures.size())
    throw std::invalid_argument("shade: a material's texture is not there");
  const RenderTexture& texture = textures[static_cast<std::size_t>(use.texture)];
  if (texture.levels.empty() || uv.empty()) return {};
  const Vec2<std::uint32_t> size_px{texture.width_px, texture.height_px};
  std::size_t site = 0;
  while (site < sites.size() && !(sites[site].size_px == size_px && sites[site].use->is_placed_like(use)))
    ++site;
  if (site == sites.size())
    sites.push_back({&use, size_px, texture.first_level, &uv, uv_matrix(use.transform)});
  sites[site].first_level = std::min(sites[site].first_level, texture.first_level);
  return {&texture, site};
}

TriangleInView FragmentShader::triangle_in_view(std::uint32_t triangle) const {
  TriangleInView out;
  out.corner = (*scene_.triangles)[triangle];
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
  out.planes = edge_planes(seen);
  return out;
}

FragmentPlace FragmentShader::place_of(std::uint32_t pixel, const RenderFragment& fragment,
                                       const TriangleInView& triangle) const {
  FragmentPlace out{
      triangle, {1 - fragment.weight1 - fragment.weight2, fragment.weight1, fragment.weight2}, {}, {}, {}};
  const Vec2d mean = mean_of_samples(fragment.mask);
  const double x = (pixel % side_px_) * kSamplesPerSide + mean.x + 0.5 - frame_.half,
               y = (pixel / side_px_) * kSamplesPerSide + mean.y + 0.5 - frame_.half;
  const double right = x * frame_.pitch, down = y * frame_.pitch;
  out.to_viewer = to_float(normalized(camera_.z + camera_.y * down - camera_.x * right));

  const EdgePlanes& planes = triangle.planes;
  double sum = 0, a = 0, b = 0;
  for (const EdgePlane& e : planes.edge) sum += e.at(x, y), a += e.a, b += e.b;
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

Vec4f FragmentShader::vertex_colour(const FragmentPlace& place) const {
  const std::vector<Vec4f>& colours = scene_.mesh->colours;
  const Vec4f a = colours[place.triangle.corner[0]], b = colours[place.triangle.corner[1]],
              d = colours[place.triangle.corner[2]];
  auto mean = [&](float x, float y, float z) {
    return x + (y - x) * place.weight[1] + (z - x) * place.weight[2];
  };
  return {mean(a.x, b.x, d.x), mean(a.y, b.y, d.y), mean(a.z, b.z, d.z), mean(a.w, b.w, d.w)};
}

// The unit normal between those of the wedges, and how much it turns within a pixel: the largest change of
// one of its coordinates before the camera.
Vec3f FragmentShader::interpolated_normal(const FragmentPlace& place, float& roughness) const {
  roughness = 0;
  const std::vector<Vec3f>& normals = scene_.mesh->normals;
  if (normals.empty()) return place.triangle.face;
  const Vec3f sum = place.mean(normals);
  const float square = dot(sum, sum);
  if (!(square > kNone && square < 1e20f)) return place.triangle.face;
  const float inverse = 1 / std::sqrt(square);
  const Vec3f normal = sum * inverse;
  const Vec3f along1 = normals[place.triangle.corner[1]] - normals[place.triangle.corner[0]],
              along2 = normals[place.triangle.corner[2]] - normals[place.triangle.corner[0]];
  for (const Vec2f step : {place.weight_dx, place.weight_dy}) {
    const Vec3f change = along1 * step.x + along2 * step.y;
    const Vec3f turn = (change - normal * dot(normal, change)) * inverse;
    for (const Vec3f& axis : axes_) {
      const float part = std::fabs(dot(turn, axis));
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
    const Vec4f tangent = mesh.tangents[place.triangle.corner[k]];
    const Vec3f direction = normalized(xyz(tangent));
    if (!(dot(direction, direction) > 0.5f)) return false;
    const Vec3f normal = mesh.normals.empty() ? place.triangle.face : mesh.normals[place.triangle.corner[k]];
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
void FragmentShader::derivative_frame(const Site& site, const FragmentPlace& place, Vec3f normal,
                                      Vec3f frame[2]) const {
  const std::vector<Vec2f>& uv = *site.uv;
  const Vec2f first = uv[place.triangle.corner[0]];
  const Vec2d along1 = to_double(site.matrix.direction(uv[place.triangle.corner[1]] - first)),
              along2 = to_double(site.matrix.direction(uv[place.triangle.corner[2]] - first));
  const Vec3d n = to_double(normal);
  const Vec3d u = cross(n, place.triangle.edge1 * along2.x - place.triangle.edge2 * along1.x);
  const Vec3d v = cross(n, place.triangle.edge2 * along1.y - place.triangle.edge1 * along2.y);
  const double square = std::max(dot(u, u), dot(v, v));
  const double scale = square > 0 && std::isfinite(square) ? 1 / std::sqrt(square) : 0;
  frame[0] = to_float(u * scale);
  frame[1] = to_float(v * scale);
}

/// One fragment with its variants, each of which takes over what an earlier one has found of the same texels.
class FragmentShader::Fragment {
 public:
  Fragment(const FragmentShader& shader, const Prepared& prepared, const FragmentPlace& place, bool back,
           Scratch& scratch)
      : shader_(shader), prepared_(prepared), place_(place), back_(back), scratch_(scratch) {
    if (scratch_.sites.size() < prepared.sites.size()) scratch_.sites.resize(prepared.sites.size());
    scratch_.known.assign(prepared.sites.size(), 0);
  }

  /// Of what colour() will read that no earlier variant has read.
  void prefetch(const Reads& reads) {
    for (std::size_t i = 0; i < reads.size(); ++i)
      if (reads[i].texture && !(read_[i] == reads[i])) site(reads[i].site).prefetch(*reads[i].texture);
  }

  FragmentColour colour(const Reads& reads) {
    const RenderMaterial& material = *prepared_.material;
    const Vec4f base = base_colour(reads);
    FragmentColour out;
    out.alpha = 1;
    if (material.alpha_mode == AlphaMode::kMask && base.w < material.alpha_cutoff) return {};
    if (material.alpha_mode == AlphaMode::kBlend) out.alpha = base.w;
    if (out.alpha == 0) return {};
    out.linear = material.unlit ? tone_mapped(xyz(base)) : lit(reads, base);
    return out;
  }

 private:
  /// Of the first variant that was lit.
  struct Known {
    Vec4f normal_texel;
    LitSurface surface;
    Lighting lighting;
    Vec3f linear;
  };

  Vec4f texel(const Reads& reads, TextureUse use) {
    const std::size_t i = index_of(use);
    if (read_[i] == reads[i]) return texel_[i];
    const Vec4f texel = site(reads[i].site).read(*reads[i].texture);
    if (!read_[i].texture) read_[i] = reads[i], texel_[i] = texel;
    return texel;
  }

  const TextureSite& site(std::size_t index) {
    TextureSite& out = scratch_.sites[index];
    if (scratch_.known[index]) return out;
    scratch_.known[index] = 1;
    const Site& site = prepared_.sites[index];
    const std::vector<Vec2f>& uv = *site.uv;
    const Vec2f first = uv[place_.triangle.corner[0]];
    const Vec2f along1 = uv[place_.triangle.corner[1]] - first,
                along2 = uv[place_.triangle.corner[2]] - first;
    TextureFootprint footprint;
    footprint.uv = site.matrix.place(first + along1 * place_.weight[1] + along2 * place_.weight[2]);
    footprint.uv_dx = site.matrix.direction(along1 * place_.weight_dx.x + along2 * place_.weight_dx.y);
    footprint.uv_dy = site.matrix.direction(along1 * place_.weight_dy.x + along2 * place_.weight_dy.y);
    return out = TextureSite(site.size_px, site.first_level, *site.use, footprint);
  }

  static bool has(const Reads& reads, TextureUse use) { return reads[index_of(use)].texture != nullptr; }

  Vec4f base_colour(const Reads& reads) {
    Vec4f c = prepared_.material->base_colour;
    auto multiply = [&c](Vec4f by) { c = {c.x * by.x, c.y * by.y, c.z * by.z, c.w * by.w}; };
    if (has(reads, TextureUse::kBaseColour)) multiply(texel(reads, TextureUse::kBaseColour));
    if (!shader_.scene_.mesh->colours.empty()) multiply(shader_.vertex_colour(place_));
    return {saturated(c.x), saturated(c.y), saturated(c.z), saturated(c.w)};
  }

  void find_frame(const Site& site) {
    if (!shader_.vertex_frame(place_, frame_)) shader_.derivative_frame(site, place_, normal_, frame_);
    has_frame_ = true;
  }

  Vec3f mapped_normal(const Reads& reads, Vec4f texel) {
    const Read& read = reads[index_of(TextureUse::kNormal)];
    if (!read.texture) return normal_;
    if (!has_frame_) find_frame(prepared_.sites[read.site]);
    const float scale = prepared_.material->normal_scale;
    const Vec3f sum = frame_[0] * ((texel.x * 2 - 1) * scale) + frame_[1] * ((texel.y * 2 - 1) * scale) +
                      normal_ * (texel.z * 2 - 1);
    const float square = dot(sum, sum);
    return square > kNone && square < 1e20f ? sum * (1 / std::sqrt(square)) : normal_;
  }

  /// All but the normal.
  LitSurface surface_of(const Reads& reads, Vec4f base) {
    const RenderMaterial& material = *prepared_.material;
    LitSurface out;
    out.base_colour = xyz(base);
    out.metallic = material.metallic;
    out.roughness = material.roughness;
    float occlusion = 1;
    const bool shared =
        reads[index_of(TextureUse::kOcclusion)] == reads[index_of(TextureUse::kMetallicRoughness)];
    if (has(reads, TextureUse::kMetallicRoughness)) {
      const Vec4f texel_here = texel(reads, TextureUse::kMetallicRoughness);
      out.roughness *= texel_here.y;
      out.metallic *= texel_here.z;
      if (shared) occlusion = texel_here.x;
    }
    if (has(reads, TextureUse::kOcclusion) && !shared) occlusion = texel(reads, TextureUse::kOcclusion).x;
    out.occlusion = saturated(1 + (occlusion - 1) * material.occlusion_strength);
    out.roughness = clamped(out.roughness, kLeastRoughness, 1) + geometry_roughness_;
    if (!(out.roughness < 1)) out.roughness = 1;
    out.emission = material.emissive;
    if (has(reads, TextureUse::kEmissive) && largest(out.emission) > 0)
      out.emission = product(out.emission, xyz(texel(reads, TextureUse::kEmissive)));
    return out;
  }

  Vec3f lit(const Reads& reads, Vec4f base) {
    const bool first = !has_known_;
    if (first) normal_ = shader_.interpolated_normal(place_, geometry_roughness_);
    LitSurface surface = surface_of(reads, base);
    const Vec4f normal_texel =
        has(reads, TextureUse::kNormal) ? texel(reads, TextureUse::kNormal) : Vec4f{0, 0, 0, -1};
    const bool same_normal = !first && normal_texel == known_.normal_texel;
    surface.normal =
        same_normal ? known_.surface.normal : mapped_normal(reads, normal_texel) * (back_ ? -1.f : 1.f);
    const bool same_lighting = same_normal && surface.roughness == known_.surface.roughness;
    if (same_lighting && surface == known_.surface) return known_.linear;
    const RenderEnvironment& environment = shader_.environment_;
    const Lighting lighting = same_lighting ? known_.lighting
                                            : lighting_of(surface, place_.to_viewer, environment,
                                                          same_normal ? &known_.lighting : nullptr);
    const Vec3f linear = tone_mapped(radiance_of(surface, lighting, environment));
    if (first) known_ = {normal_texel, surface, lighting, linear};
    has_known_ = true;
    return linear;
  }

  const FragmentShader& shader_;
  const Prepared& prepared_;
  const FragmentPlace& place_;
  const bool back_;
  Scratch& scratch_;
  Reads read_{};
  std::array<Vec4f, kTextureUses> texel_{};
  Vec3f normal_;  // between those of the wedges
  float geometry_roughness_ = 0;
  Vec3f frame_[2];
  bool has_frame_ = false, has_known_ = false;
  Known known_;
};

void FragmentShader::colours_of(std::uint32_t pixel, const RenderFragment& fragment, Scratch& scratch,
                                std::span<FragmentColour> out) const {
  const RenderMaterial& material = scene_.material_of(fragment.triangle);
  const Prepared& prepared = materials_[static_cast<std::size_t>(&material - scene_.materials->data())];
  Scratch::Seen& seen = scratch.triangles[fragment.triangle % Scratch::kTriangles];
  if (seen.index != fragment.triangle) seen = {fragment.triangle, triangle_in_view(fragment.triangle)};
  const FragmentPlace place = place_of(pixel, fragment, seen.in_view);
  Fragment here(*this, prepared, place, fragment.back != 0, scratch);
  if (out.size() > 1) here.prefetch(prepared.variants[0]);
  for (std::size_t v = 0; v < out.size(); ++v) {
    if (v + 1 < out.size()) here.prefetch(prepared.variants[v + 1]);
    out[v] = here.colour(prepared.variants[v]);
  }
}

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
  if (!environment.levels.empty()) {
    // A rough lobe's mean direction leans towards the normal.
    const Vec3f mirror = s.normal * (2 * cosine) - to_viewer;
    const Vec3f direction = normalized(mixed(mirror, s.normal, s.roughness * s.roughness));
    out.glossy = specular_light(environment, direction, s.roughness);
  }
  out.occlusion = s.occlusion;
  out.occluded = specular_occlusion(out.n_dot_v, s.occlusion, s.roughness);
  return out;
}

Vec3f radiance_of(const LitSurface& s, const Lighting& lighting, const RenderEnvironment& environment) {
  return product(reflected_from_key(s, lighting), environment.key.irradiance) +
         reflected_surroundings(s, lighting) + s.emission;
}

}  // namespace texmesh
