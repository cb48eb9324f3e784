#include "stages/proxies/making/make_proxy.h"

#include <algorithm>
#include <cmath>

#include "stages/proxies/packing/pack_atlas.h"
#include "stages/proxies/surface/simplify_surface.h"

namespace texmesh::proxies {
namespace {

constexpr double kJsonBytes = 2200;  // of a GLB with one material, and the heads of its pictures
constexpr double kOver = 1.02;       // of the bytes asked for
constexpr std::uint32_t kGutterPx = 1;
constexpr std::uint32_t kTexelStep = 32, kLeastTexels = 32, kMostTexels = 2048;
constexpr double kCover = 0.58;                                         // of an atlas' texels
constexpr double kColourBits = 2.0, kNormalBits = 1.4, kOrmBits = 0.9;  // a covered texel
constexpr std::size_t kSamples = 400000;

/// The side of a square texture whose maps cost so many bytes.
std::uint32_t texture_side(double bytes, const MapChoice& maps) {
  const double bits = kColourBits + (maps.normal ? kNormalBits : 0) + (maps.orm ? kOrmBits : 0);
  const double side = std::sqrt(std::max(bytes, 1.0) * 8 / (bits * kCover));
  const auto steps = static_cast<std::uint32_t>(std::clamp(side / kTexelStep + 0.5, 1.0, 64.0));
  return std::clamp(steps * kTexelStep, kLeastTexels, kMostTexels);
}

/// Packs at the side, or at the least larger one that holds the charts.
std::optional<AtlasMesh> pack(const ChartedSurface& charted, std::uint32_t side_px,
                              const RunContext& context) {
  for (; side_px <= kMostTexels; side_px += side_px / 2) {
    auto atlas = pack_atlas(charted.surface, charted.charts, side_px, side_px, kGutterPx, context);
    if (atlas) return atlas;
  }
  return std::nullopt;
}

struct CodedAtlas {
  AtlasMesh atlas;
  std::vector<Vec3f> normals;
  CodedMesh mesh;
};

std::optional<CodedAtlas> code_atlas(const ProxyWorkshop& shop, const ChartedSurface& charted,
                                     std::uint32_t side_px, const MeshCoding& coding,
                                     const RunContext& context) {
  auto atlas = pack(charted, side_px, context);
  if (!atlas) return std::nullopt;
  CodedAtlas out{std::move(*atlas), {}, {}};
  out.normals = sampled_normals(out.atlas, shop.source, context);
  std::vector<bool> lit;
  for (const MaterialGroup& g : shop.groups.groups) lit.push_back(!g.unlit);
  out.mesh = code_mesh(out.atlas, out.normals, lit, coding);
  return out;
}

std::vector<ProxyTexture> textures_of(const ProxyPictures& pictures) {
  std::vector<ProxyTexture> out;
  const auto add = [&](const char* use, const ProxyImage& image) {
    out.push_back({use, image.width_px, image.height_px, image.file.size()});
  };
  add("base-colour", pictures.base_colour);
  if (pictures.orm) add("metallic-roughness", *pictures.orm);
  if (pictures.normal) add("normal", *pictures.normal);
  if (pictures.emission) add("emissive", *pictures.emission);
  return out;
}

MadeProxy finish(const ProxyWorkshop& shop, const CodedAtlas& coded, std::uint64_t target_bytes,
                 const ByteSplit& split, const RunContext& context) {
  const std::vector<MaterialGroup>& groups = shop.groups.groups;
  const MapPixels maps = map_pixels(bake(coded.atlas, coded.normals, shop.source, kSamples, context), split.maps);
  const double left = static_cast<double>(target_bytes) - static_cast<double>(coded.mesh.bytes());
  ProxyPictures pictures = code_pictures(maps, static_cast<std::size_t>(std::max(left - kJsonBytes, 0.0)));
  MadeProxy out;
  out.proxy.glb = proxy_glb(coded.mesh, groups, pictures);
  out.proxy.target_bytes = target_bytes;
  for (const CodedGroup& g : coded.mesh.groups) {
    out.proxy.triangles += static_cast<std::uint32_t>(g.triangles());
    out.proxy.vertices += static_cast<std::uint32_t>(g.vertices());
  }
  out.proxy.textures = textures_of(pictures);
  out.shown = shown_proxy(coded.atlas, rounded_mesh(coded.atlas, coded.normals, split.mesh), groups, pictures);
  return out;
}

}  // namespace

SurfaceLadder::SurfaceLadder(const Mesh& mesh, const MaterialGroups& groups, std::uint32_t least,
                             std::uint32_t most, const RunContext& context) {
  constexpr double kStep = 0.84;
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

const ChartedSurface* SurfaceLadder::at_most(double triangles, const RunContext& context) {
  std::size_t i = 0;
  while (i + 1 < surfaces_.size() && static_cast<double>(surfaces_[i].triangles.size()) > triangles) ++i;
  if (surfaces_.empty() || surfaces_[i].triangles.empty()) return nullptr;
  if (!charted_[i]) charted_[i] = ChartedSurface{surfaces_[i], segment_charts(surfaces_[i], context)};
  return &*charted_[i];
}

std::optional<MadeProxy> ProxyWorkshop::make(std::uint64_t target_bytes, const ByteSplit& split,
                                             const RunContext& context) {
  const auto target = static_cast<double>(target_bytes);
  const double mesh_bytes = split.mesh_share * target;
  const std::uint32_t side_px = getenv("SIDE")?atoi(getenv("SIDE")):texture_side(target - mesh_bytes - kJsonBytes, split.maps);
  std::optional<CodedAtlas> coded;
  double bytes_per_triangle = split.mesh.draco ? 3.4 : 9.5;
  // The bytes of a triangle are known once one mesh is coded; the second try is the last.
  for (int attempt = 0; attempt < 3; ++attempt) {
    const ChartedSurface* charted = surfaces.at_most(mesh_bytes / bytes_per_triangle, context);
    if (!charted) return std::nullopt;
    coded = code_atlas(*this, *charted, side_px, split.mesh, context);
    if (!coded || coded->mesh.groups.empty()) return std::nullopt;
    const auto bytes = static_cast<double>(coded->mesh.bytes());
    bytes_per_triangle = bytes / static_cast<double>(charted->surface.triangles.size());
    if (bytes <= 1.1 * mesh_bytes && bytes >= 0.8 * mesh_bytes) break;
  }
  MadeProxy made = finish(*this, *coded, target_bytes, split, context);
  if (static_cast<double>(made.proxy.glb.size()) > kOver * target) return std::nullopt;
  return made;
}

}  // namespace texmesh::proxies
