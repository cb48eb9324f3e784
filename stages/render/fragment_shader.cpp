#include "stages/render/fragment_shader.h"

#include <cstring>

#include "stages/render/shade.h"

namespace texmesh {
namespace {

constexpr float kNone = 1e-20f;  // squares below this are no length

Vec3f xyz(Vec4f v) { return {v.x, v.y, v.z}; }

std::size_t index_of(TextureUse use) { return static_cast<std::size_t>(use); }

/// Whether bits are the same in all lanes.
template <class T>
bool same(const T& a, const T& b) {
  return std::memcmp(&a, &b, sizeof a) == 0;
}

void put(Vec3<Lanes>& to, std::size_t lane, Vec3f v) { to.x[lane] = v.x, to.y[lane] = v.y, to.z[lane] = v.z; }

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

  /// The colour that lighting does not change, and into the lane what it needs.
  FragmentColour gather(const Reads& reads, std::size_t lane, VariantLanes& to) {
    const RenderMaterial& material = *prepared_.material;
    const Vec4f base = base_colour(reads);
    FragmentColour out;
    out.alpha = material.alpha_mode == AlphaMode::kBlend ? base.w : 1;
    if (material.alpha_mode == AlphaMode::kMask && base.w < material.alpha_cutoff) out.alpha = 0;
    to.is_lit[lane] = out.alpha != 0 && !material.unlit;
    if (to.is_lit[lane])
      put_surface(reads, base, lane, to);
    else if (out.alpha != 0)
      out.linear = tone_mapped(xyz(base));
    return out;
  }

  /// Behind all variants.
  void put_place(std::size_t lane, FragmentLanes& to) const {
    put(to.to_viewer, lane, place_.to_viewer);
    put(to.normal, lane, normal_);
    for (std::size_t k = 0; k < 2; ++k) put(to.frame[k], lane, frame_[k]);
    to.normal_scale[lane] = prepared_.material->normal_scale;
    to.side[lane] = back_ ? -1.f : 1.f;
  }

 private:
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

  /// All but the normal.
  void put_surface(const Reads& reads, Vec4f base, std::size_t lane, VariantLanes& to) {
    if (!has_normal_) normal_ = shader_.interpolated_normal(place_, geometry_roughness_);
    has_normal_ = true;
    const RenderMaterial& material = *prepared_.material;
    float metallic = material.metallic, roughness = material.roughness, occlusion = 1;
    const bool shared =
        reads[index_of(TextureUse::kOcclusion)] == reads[index_of(TextureUse::kMetallicRoughness)];
    if (has(reads, TextureUse::kMetallicRoughness)) {
      const Vec4f texel_here = texel(reads, TextureUse::kMetallicRoughness);
      roughness *= texel_here.y;
      metallic *= texel_here.z;
      if (shared) occlusion = texel_here.x;
    }
    if (has(reads, TextureUse::kOcclusion) && !shared) occlusion = texel(reads, TextureUse::kOcclusion).x;
    roughness = clamped(roughness, kLeastRoughness, 1) + geometry_roughness_;
    Vec3f emission = material.emissive;
    if (has(reads, TextureUse::kEmissive) && largest(emission) > 0)
      emission = product(emission, xyz(texel(reads, TextureUse::kEmissive)));
    put(to.surface.base_colour, lane, xyz(base));
    put(to.surface.emission, lane, emission);
    to.surface.metallic[lane] = metallic;
    to.surface.roughness[lane] = roughness < 1 ? roughness : 1;
    to.surface.occlusion[lane] = saturated(1 + (occlusion - 1) * material.occlusion_strength);
    Vec4f normal_texel{0, 0, 0, -1};
    if (has(reads, TextureUse::kNormal)) {
      normal_texel = texel(reads, TextureUse::kNormal);
      if (!has_frame_) find_frame(prepared_.sites[reads[index_of(TextureUse::kNormal)].site]);
    }
    to.normal_texel.x[lane] = normal_texel.x, to.normal_texel.y[lane] = normal_texel.y;
    to.normal_texel.z[lane] = normal_texel.z, to.normal_texel.w[lane] = normal_texel.w;
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
  bool has_frame_ = false, has_normal_ = false;
};

void FragmentShader::gather(const FragmentInPixel& seen, std::size_t lane, Scratch& scratch,
                            std::span<FragmentColour> out) const {
  const RenderFragment& fragment = seen.fragment;
  const RenderMaterial& material = scene_.material_of(fragment.triangle);
  const Prepared& prepared = materials_[static_cast<std::size_t>(&material - scene_.materials->data())];
  Scratch::Seen& triangle = scratch.triangles[fragment.triangle % Scratch::kTriangles];
  if (triangle.index != fragment.triangle)
    triangle = {fragment.triangle, triangle_in_view(fragment.triangle)};
  const FragmentPlace place = place_of(seen.pixel, fragment, triangle.in_view);
  Fragment here(*this, prepared, place, fragment.back != 0, scratch);
  if (out.size() > 1) here.prefetch(prepared.variants[0]);
  for (std::size_t v = 0; v < out.size(); ++v) {
    if (v + 1 < out.size()) here.prefetch(prepared.variants[v + 1]);
    out[v] = here.gather(prepared.variants[v], lane, scratch.variants[v]);
  }
  here.put_place(lane, scratch.lanes);
}

namespace {

Vec3<Lanes> mapped_normal(const auto& at, const Vec4<Lanes>& texel) {
  const Vec3<Lanes> sum = at.frame[0] * ((texel.x * 2 - 1) * at.normal_scale) +
                          at.frame[1] * ((texel.y * 2 - 1) * at.normal_scale) + at.normal * (texel.z * 2 - 1);
  const Lanes square = dot(sum, sum), scale = 1 / root_of(square);
  const LaneInts is_mapped = (texel.w >= 0) & (square > kNone) & (square < 1e20f);
  Vec3<Lanes> out;
  for (int k = 0; k < 3; ++k) out[k] = (is_mapped ? sum[k] * scale : at.normal[k]) * at.side;
  return out;
}

}  // namespace

/// Each variant takes over what the first one that is lit has found of the same texels.
void FragmentShader::light(std::size_t lanes, Scratch& scratch, std::span<FragmentColour> out) const {
  const std::size_t variants = scratch.variants.size();
  const VariantLanes* first = nullptr;
  LightingOf<Lanes> first_lighting;
  Vec3<Lanes> first_linear;
  for (std::size_t v = 0; v < variants; ++v) {
    VariantLanes& here = scratch.variants[v];
    if (!any(here.is_lit != 0)) continue;
    const bool same_normal = first && same(here.normal_texel, first->normal_texel);
    here.surface.normal =
        same_normal ? first->surface.normal : mapped_normal(scratch.lanes, here.normal_texel);
    Vec3<Lanes> linear;
    if (first && same(here.surface, first->surface)) {
      linear = first_linear;
    } else {
      const bool same_lighting = same_normal && same(here.surface.roughness, first->surface.roughness);
      const LightingOf<Lanes> lighting =
          same_lighting ? first_lighting
                        : lighting_of(here.surface, scratch.lanes.to_viewer, environment_,
                                      same_normal ? &first_lighting : nullptr);
      linear = tone_mapped_of(radiance_of(here.surface, lighting, environment_));
      if (!first) first = &here, first_lighting = lighting, first_linear = linear;
    }
    for (std::size_t i = 0; i < lanes; ++i)
      if (here.is_lit[i]) out[i * variants + v].linear = {linear.x[i], linear.y[i], linear.z[i]};
  }
}

void FragmentShader::colours_of(std::span<const FragmentInPixel> fragments, Scratch& scratch,
                                std::span<FragmentColour> out) const {
  const std::size_t variants = out.size() / fragments.size();
  scratch.variants.resize(variants);
  for (std::size_t begin = 0; begin < fragments.size(); begin += kLanes) {
    const std::size_t lanes = std::min(kLanes, fragments.size() - begin);
    for (std::size_t i = 0; i < lanes; ++i)
      gather(fragments[begin + i], i, scratch, out.subspan((begin + i) * variants, variants));
    light(lanes, scratch, out.subspan(begin * variants, lanes * variants));
  }
}

}  // namespace texmesh
