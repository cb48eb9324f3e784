#include "delivery/cpp/decide/gpu_memory.h"

#include <algorithm>
#include <optional>

namespace texmesh {
namespace {

constexpr double kMeshShare = 0.5;  // a mesh may take so much where a coarser one takes less
constexpr std::uint64_t kVertexBytes = 4 * (3 + 3 + 2 + 4), kTriangleBytes = 3 * 4, kProxyTextures = 4;

std::uint64_t level_bytes(std::uint64_t width_px, std::uint64_t height_px, GpuTexels texels) {
  if (texels == GpuTexels::kRgba8) return 4 * width_px * height_px;
  const std::uint64_t blocks = (width_px + 3) / 4 * ((height_px + 3) / 4);
  return blocks * (texels == GpuTexels::kBlock8 ? 8 : 16);
}

/// The next coarser mip of the texture.
std::optional<std::uint32_t> coarser(const std::vector<TextureInfo>& textures, const PlaneChoice& choice) {
  const std::uint32_t now = textures[choice.plane].mip;
  std::optional<std::uint32_t> best;
  for (std::uint32_t p = 0; p < textures.size(); ++p) {
    const TextureInfo& t = textures[p];
    if (t.mip == 0 || t.base != choice.base || t.mip <= now) continue;
    if (!best || t.mip < textures[*best].mip) best = p;
  }
  return best;
}

}  // namespace

std::uint64_t gpu_texture_bytes(std::uint32_t width_px, std::uint32_t height_px, GpuTexels texels) {
  std::uint64_t bytes = 0;
  for (std::uint32_t longest = std::max(width_px, height_px), level = 0; longest > 0; longest >>= 1, ++level)
    bytes += level_bytes(std::max(1u, width_px >> level), std::max(1u, height_px >> level), texels);
  return bytes;
}

std::uint64_t gpu_mesh_bytes(std::uint32_t vertices, std::uint32_t triangles) {
  return kVertexBytes * vertices + kTriangleBytes * triangles;
}

GpuBytes gpu_proxy(const ManifestProxy& p) {
  return {gpu_mesh_bytes(p.vertices, p.triangles),
          kProxyTextures * gpu_texture_bytes(p.texture_px, p.texture_px)};
}

GpuBytes gpu_scale(PackageReader& package, int scale, std::span<const PlaneChoice> planes) {
  GpuBytes bytes;
  const std::vector<ManifestScale>& scales = package.manifest().scales;
  if (const auto s = std::ranges::find(scales, scale, &ManifestScale::scale); s != scales.end())
    bytes.mesh = gpu_mesh_bytes(s->vertices, s->triangles);
  for (const PlaneChoice& c : planes) {
    const TextureInfo& t = package.textures()[c.plane];
    bytes.textures += gpu_texture_bytes(t.width_px, t.height_px);
  }
  return bytes;
}

int scale_within(std::span<const ManifestScale> scales, int scale, double most_bytes) {
  for (const ManifestScale& s : scales)
    if (s.scale >= scale &&
        static_cast<double>(gpu_mesh_bytes(s.vertices, s.triangles)) <= kMeshShare * most_bytes)
      return s.scale;
  return scales.back().scale;
}

std::vector<PlaneChoice> planes_within(TextureLoss& loss, std::vector<PlaneChoice> planes,
                                       double most_bytes) {
  const std::vector<TextureInfo>& textures = loss.package().textures();
  const auto bytes_of = [&](std::uint32_t plane) {
    return static_cast<double>(gpu_texture_bytes(textures[plane].width_px, textures[plane].height_px));
  };
  std::vector<PlaneChoice> full = planes;
  for (PlaneChoice& c : full) c.plane = c.base;
  const PerGroup surface = loss.weights(full);
  double bytes = 0;
  for (const PlaneChoice& c : planes) bytes += bytes_of(c.plane);
  while (bytes > most_bytes) {
    PlaneChoice* best = nullptr;
    std::uint32_t best_plane = 0;
    double best_saved = 0, best_price = 0;
    for (PlaneChoice& c : planes) {
      const std::optional<std::uint32_t> plane = coarser(textures, c);
      if (!plane) continue;
      const double saved = bytes_of(c.plane) - bytes_of(*plane);
      const double of_group = surface[static_cast<std::size_t>(loss.group_of(c.base))];
      const double share = loss.plane(c.base).weight / (of_group != 0 ? of_group : 1);
      const double price = (loss.mip(*plane) - loss.mip(c.plane)) * share / saved;
      if (best && price >= best_price) continue;
      best = &c, best_plane = *plane, best_saved = saved, best_price = price;
    }
    if (best == nullptr) break;
    best->plane = best_plane;
    bytes -= best_saved;
  }
  return planes;
}

}  // namespace texmesh
