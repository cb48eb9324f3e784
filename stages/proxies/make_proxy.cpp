#include "stages/proxies/make_proxy.h"

#include "format/base/portable_math.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/image/webp.h"
#include "stages/proxies/simplify_surface.h"

namespace texmesh {
namespace {

constexpr double kJsonBytes = 1900;  // about, of a GLB with one material
constexpr std::uint32_t kGutterPx = 1;
constexpr std::uint32_t kTexelStep = 32, kLeastTexels = 32, kMostTexels = 1024;
constexpr double kCover = 0.58;  // of an atlas' texels
// Of a covered texel at the quality aimed at; textures that take fewer or more teach it.
constexpr double kColourBits = 2.4, kOrmBits = 1.6;
constexpr double kAimedQuality = 50, kQualitiesOfE = 45;     // so many above it take e times the bytes
constexpr double kLeastTexelBits = 0.3, kMostTexelBits = 3;  // times the above
constexpr const char *kColourUse = "base-colour", *kDataUse = "metallic-roughness";
constexpr double kMeshoptBytes = 9.5, kDracoBytes = 3.2;  // of a triangle, until one mesh is coded
constexpr int kAttempts = 3;
constexpr double kLeastMiss = 0.7, kMostMiss = 1.2;  // of a mesh' bytes: textures take what is left
constexpr double kWorthPacking = 1.15;               // a larger texture of the same mesh, side to side
constexpr std::size_t kSamples = 250000;

/// Packs at the side, or at the least larger one that holds the charts.
std::optional<AtlasMesh> pack(const ChartedSurface& charted, std::uint32_t side_px,
                              const RunContext& context) {
  for (; side_px <= kMostTexels; side_px += side_px / 2) {
    auto atlas = pack_atlas(charted.surface, charted.charts, side_px, side_px, kGutterPx, context);
    if (atlas) return atlas;
  }
  return std::nullopt;
}

CreaseUse creases_of(const ProxyForm& form) {
  return form.maps.normal ? CreaseUse::kWhereChartsEnd : CreaseUse::kAll;
}

/// Flat triangles need no vertices on both sides of a crease.
struct ShapeOf {
  const AtlasMesh& mesh;
  std::vector<Vec3f> normals;
  ShapeOf(const BakedProxy& baked, const ProxyForm& form)
      : mesh(form.normals ? baked.smooth.mesh : baked.atlas),
        normals(form.normals ? baked.smooth.normals : std::vector<Vec3f>{}) {}
};

/// All of the file that is neither mesh nor picture; offsets of pictures take a few digits more.
double frame_bytes(const CodedMesh& mesh, const std::vector<MaterialGroup>& groups, const MapPixels& maps) {
  constexpr double kDigits = 40;
  ProxyPictures none;
  none.metallic = maps.metallic, none.roughness = maps.roughness, none.emissive = maps.emissive;
  if (maps.choice.orm) none.orm.emplace();
  if (maps.choice.normal) none.normal.emplace();
  if (!maps.emission.data.empty()) none.emission.emplace();
  return static_cast<double>(proxy_glb(mesh, groups, none).size()) + kDigits;
}

std::vector<ProxyTexture> textures_of(const ProxyPictures& pictures) {
  std::vector<ProxyTexture> out;
  const auto add = [&](const char* use, const ProxyImage& image) {
    out.push_back({use, image.width_px, image.height_px, image.file.size()});
  };
  add(kColourUse, pictures.base_colour);
  if (pictures.orm) add(kDataUse, *pictures.orm);
  if (pictures.normal) add("normal", *pictures.normal);
  if (pictures.emission) add("emissive", *pictures.emission);
  return out;
}

/// The side of a square texture whose maps cost so many bytes.
std::uint32_t texture_side(double bytes, const MapChoice& maps, double texel_bits) {
  const double bits = (kColourBits + (maps.orm ? kOrmBits : 0)) * texel_bits;
  const double side = std::sqrt(std::max(bytes, 1.0) * 8 / (bits * kCover));
  const auto steps = static_cast<std::uint32_t>(std::clamp(side / kTexelStep + 0.5, 1.0, 64.0));
  return std::clamp(steps * kTexelStep, kLeastTexels, kMostTexels);
}

CodedMesh coded_mesh(const BakedProxy& baked, const std::vector<MaterialGroup>& groups,
                     const ProxyForm& form) {
  const ShapeOf shape(baked, form);
  std::vector<bool> with_normals;
  for (const MaterialGroup& g : groups) with_normals.push_back(form.normals && !g.unlit);
  return code_mesh(shape.mesh, shape.normals, with_normals, form.coding);
}

/// A packed surface whose mesh takes about so many bytes.
std::optional<BakedProxy> packed_proxy(const BakeSource& source, const MaterialGroups& groups,
                                       CoarseSurfaces& surfaces, ProxyCosts& costs, double mesh_bytes,
                                       std::uint32_t side_px, const ProxyForm& form,
                                       const RunContext& context) {
  double& of_triangle = costs.bytes_per_triangle[form.coding.draco ? 1 : 0][form.normals ? 1 : 0];
  if (of_triangle == 0) of_triangle = form.coding.draco ? kDracoBytes : kMeshoptBytes;
  std::optional<BakedProxy> out;
  const ChartedSurface* last = nullptr;
  // The bytes of a triangle are known once one mesh is coded.
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    const ChartedSurface* charted = surfaces.at_most(mesh_bytes / of_triangle, context);
    if (!charted) return std::nullopt;
    if (charted == last) break;
    last = charted;
    auto atlas = pack(*charted, side_px, context);
    if (!atlas) return std::nullopt;
    out.emplace();
    out->charted = charted;
    out->atlas = std::move(*atlas);
    out->smooth = sampled_normals(out->atlas, source, creases_of(form), context);
    const CodedMesh& mesh = out->meshes[form.normals ? 1 : 0].emplace(coded_mesh(*out, groups.groups, form));
    if (mesh.groups.empty()) return std::nullopt;
    const auto bytes = static_cast<double>(mesh.bytes());
    out->mesh_bytes = bytes;
    of_triangle = bytes / static_cast<double>(charted->surface.triangles.size());
    if (bytes <= kMostMiss * mesh_bytes && bytes >= kLeastMiss * mesh_bytes) break;
  }
  return out;
}

RenderTexture decoded(const ProxyImage& image, bool srgb, const RunContext& context) {
  return render_texture(decode_webp_rgba(image.file), srgb, 0, context);
}

RenderMaterial proxy_material(const MaterialGroup& group, const ProxyPictures& pictures) {
  RenderMaterial out;
  const auto use = [&](TextureUse slot, std::int32_t texture) {
    out.slot(slot).texture = texture;
    out.slot(slot).wrap_s = out.slot(slot).wrap_t = Wrap::kClamp;
    if (!pictures.mip_levels) out.slot(slot).min_filter = MinFilter::kLinear;
  };
  out.unlit = group.unlit, out.double_sided = group.double_sided, out.alpha_mode = group.alpha_mode;
  out.metallic = pictures.metallic, out.roughness = pictures.roughness;
  std::int32_t next = 0;
  use(TextureUse::kBaseColour, next++);
  if (pictures.orm) {
    out.metallic = out.roughness = 1;
    use(TextureUse::kMetallicRoughness, next);
    use(TextureUse::kOcclusion, next++);
  }
  if (pictures.normal) use(TextureUse::kNormal, next++);
  if (pictures.emission) {
    out.emissive = pictures.emissive;
    use(TextureUse::kEmissive, next++);
  }
  return out;
}

}  // namespace

CoarseSurfaces::CoarseSurfaces(const Mesh& mesh, const MaterialGroups& groups, std::uint32_t least,
                               std::uint32_t most, const RunContext& context) {
  constexpr double kStep = 0.88;
  std::vector<std::uint32_t> counts;
  for (double count = most; count >= least; count *= kStep)
    counts.push_back(static_cast<std::uint32_t>(count));
  if (counts.empty()) counts.push_back(std::max(most, 1u));
  std::vector<Triangle> triangles;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t)
    triangles.push_back({mesh.position_of(t, 0), mesh.position_of(t, 1), mesh.position_of(t, 2)});
  surfaces_ = simplify_surface(mesh.positions, triangles, groups.triangle_group, counts, context);
  charted_.resize(surfaces_.size());
}

const ChartedSurface* CoarseSurfaces::at_most(double triangles, const RunContext& context) {
  std::size_t i = 0;
  while (i + 1 < surfaces_.size() && static_cast<double>(surfaces_[i].triangles.size()) > triangles) ++i;
  if (surfaces_.empty() || surfaces_[i].triangles.empty()) return nullptr;
  if (!charted_[i]) charted_[i] = ChartedSurface{surfaces_[i], segment_charts(surfaces_[i], context)};
  return &*charted_[i];
}

std::optional<BakedProxy> bake_proxy(const BakeSource& source, const MaterialGroups& groups,
                                     CoarseSurfaces& surfaces, ProxyCosts& costs, double target_bytes,
                                     const ProxyForm& form, const RunContext& context) {
  const double mesh_bytes = form.mesh_share * target_bytes, others = target_bytes - kJsonBytes;
  const auto side_for = [&](double bytes) { return texture_side(bytes, form.maps, costs.texel_bits); };
  auto out =
      packed_proxy(source, groups, surfaces, costs, mesh_bytes, side_for(others - mesh_bytes), form, context);
  if (!out) return out;
  // Where the whole object has few triangles, textures get the rest.
  const std::uint32_t side_px = side_for(others - out->mesh_bytes);
  if (side_px >= kWorthPacking * out->atlas.width_px)
    if (auto larger = pack(*out->charted, side_px, context)) {
      out->atlas = std::move(*larger);
      out->meshes = {};
      out->smooth = sampled_normals(out->atlas, source, creases_of(form), context);
    }
  const BakeOrder order{kSamples, form.maps.normal};
  out->maps = bake(out->smooth.mesh, out->smooth.normals, source, order, context);
  return out;
}

std::optional<MadeProxy> finish_proxy(BakedProxy& baked, const MaterialGroups& all_groups,
                                      std::uint64_t target_bytes, const ProxyForm& form) {
  const std::vector<MaterialGroup>& groups = all_groups.groups;
  const MapPixels maps = map_pixels(baked.maps, form.maps);
  std::optional<CodedMesh>& known = baked.meshes[form.normals ? 1 : 0];
  if (!known) known = coded_mesh(baked, groups, form);
  const CodedMesh& mesh = *known;
  const double left = static_cast<double>(target_bytes) - frame_bytes(mesh, groups, maps);
  ProxyPictures pictures = code_pictures(maps, static_cast<std::size_t>(std::max(left, 0.0)), baked.pictures);
  pictures.mip_levels = all_groups.mip_levels;
  MadeProxy out;
  out.quality = pictures.quality;
  out.proxy.glb = proxy_glb(mesh, groups, pictures);
  if (static_cast<double>(out.proxy.glb.size()) > kOverAsked * static_cast<double>(target_bytes))
    return std::nullopt;
  out.proxy.target_bytes = target_bytes;
  for (const CodedGroup& g : mesh.groups) {
    out.proxy.triangles += static_cast<std::uint32_t>(g.triangles());
    out.proxy.vertices += static_cast<std::uint32_t>(g.vertices());
  }
  out.proxy.textures = textures_of(pictures);
  const ShapeOf shape(baked, form);
  out.shown = shown_proxy(shape.mesh, rounded_mesh(shape.mesh, shape.normals, form.coding), groups, pictures);
  return out;
}

std::optional<double> texel_bits_of(const MadeProxy& made) {
  double bytes = 0, expected = 0;
  for (const ProxyTexture& t : made.proxy.textures) {
    const double bits = t.use == kColourUse ? kColourBits : t.use == kDataUse ? kOrmBits : 0;
    if (bits == 0) continue;
    bytes += static_cast<double>(t.bytes);
    expected += bits / 8 * kCover * t.width_px * t.height_px;
  }
  if (!(expected > 0)) return std::nullopt;
  const double found = bytes / expected * portable::exp((kAimedQuality - made.quality) / kQualitiesOfE);
  return std::clamp(found, kLeastTexelBits, kMostTexelBits);
}

bool is_smooth(const Mesh& mesh) {
  constexpr float kTurned2 =
      1e-6f;  // of normals' difference, squared: what rounding to 16 bits makes is less
  if (mesh.normals.empty()) return false;
  double all = 0, turning = 0;
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    const Triangle& corner = mesh.triangles[t];
    const auto [a, b, c] = corner_points(mesh, corner);
    const double area = length(cross(b - a, c - a));
    const Vec3f first = mesh.normals[corner[0]], turn1 = mesh.normals[corner[1]] - first,
                turn2 = mesh.normals[corner[2]] - first;
    all += area;
    if (dot(turn1, turn1) > kTurned2 || dot(turn2, turn2) > kTurned2) turning += area;
  }
  return all > 0 && turning >= all / 2;
}

ShownModel shown_proxy(const AtlasMesh& mesh, const RoundedMesh& rounded,
                       const std::vector<MaterialGroup>& groups, const ProxyPictures& pictures) {
  ShownModel out;
  RunContext context;
  out.mesh.positions = rounded.positions;
  out.mesh.normals = rounded.normals;
  out.mesh.uv0 = rounded.uvs;
  for (std::uint32_t v = 0; v < rounded.positions.size(); ++v) out.mesh.wedge_position.push_back(v);
  out.mesh.triangles = mesh.triangles;
  for (const std::uint32_t g : mesh.group_of)
    out.mesh.triangle_material.push_back(static_cast<std::uint16_t>(g));
  out.mesh.triangle_part.assign(mesh.triangles.size(), 0);
  out.mesh.part_names = {""};
  for (const MaterialGroup& g : groups) out.shown.materials.push_back(proxy_material(g, pictures));
  out.shown.textures.push_back(decoded(pictures.base_colour, true, context));
  if (pictures.orm) out.shown.textures.push_back(decoded(*pictures.orm, false, context));
  if (pictures.normal) out.shown.textures.push_back(decoded(*pictures.normal, false, context));
  if (pictures.emission) out.shown.textures.push_back(decoded(*pictures.emission, true, context));
  return out;
}

}  // namespace texmesh
