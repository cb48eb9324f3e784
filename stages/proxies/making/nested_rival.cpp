#include "stages/proxies/making/nested_rival.h"

#include <algorithm>
#include <array>

#include "stages/geometry/scale_frames.h"

namespace texmesh::proxies {
namespace {

// Draco's meshes of the scans that docs/figures.md lists, within 20 %.
constexpr double kBytesPerWedge = 4, kBytesPerTriangle = 0.6;
constexpr double kBitsPerTexel = 1.2;  // of a JPEG of middle quality, the texels of the whole image
constexpr double kFrameBytes = 2500, kPictureBytes = 600;    // of a file without mesh and texels
constexpr std::array<double, 3> kMeshShares{0.6, 0.4, 0.8};  // likely winners first
constexpr double kFarOff = 1.5;  // times the proxy's FLIP: no other scale makes up for it

double mesh_bytes(const NestedScales& scales, std::size_t index, std::vector<std::uint8_t>& used) {
  used.assign(scales.mesh.wedge_count(), 0);
  const NestedScale& scale = scales.scales[index];
  double wedges = 0;
  for (const Triangle& t : scale.triangles)
    for (const std::uint32_t w : t) {
      wedges += used[w] ? 0 : 1;
      used[w] = 1;
    }
  return kBytesPerWedge * wedges + kBytesPerTriangle * static_cast<double>(scale.triangles.size());
}

/// Textures without the levels that cost too much.
std::vector<RenderTexture> affordable(const std::vector<RenderTexture>& textures, double bytes) {
  std::vector<RenderTexture> out = textures;
  for (;;) {
    double texels = 0;
    bool coarser = false;
    for (const RenderTexture& t : out) {
      texels += static_cast<double>(t.levels.front().width_px) * t.levels.front().height_px;
      coarser = coarser || t.levels.size() > 1;
    }
    if (texels * kBitsPerTexel / 8 <= bytes || !coarser) return out;
    for (RenderTexture& t : out) {
      if (t.levels.size() < 2) continue;
      t.levels.erase(t.levels.begin());
      ++t.first_level;
    }
  }
}

}  // namespace

double whole_mesh_bytes(const NestedScales& scales) {
  std::vector<std::uint8_t> used;
  return mesh_bytes(scales, 0, used);
}

bool whole_mesh_is_small(const NestedScales& scales, std::uint64_t bytes) {
  constexpr double kSmall = 0.4, kSmallInPieces = 0.15, kPieces = 1.5;
  const bool in_pieces = static_cast<double>(scales.mesh.wedge_count()) >
                         kPieces * static_cast<double>(scales.mesh.positions.size());
  const double share = in_pieces ? kSmallInPieces : kSmall;
  return whole_mesh_bytes(scales) <= share * static_cast<double>(bytes);
}

bool rival_wins(const NestedScales& scales, const ShownMaterials& shown, std::uint64_t bytes, double flip,
                ProxyStudio& studio, const RunContext& context) {
  const double all = std::max(0.0, static_cast<double>(bytes) - kFrameBytes -
                                       kPictureBytes * static_cast<double>(shown.textures.size()));
  std::vector<std::uint8_t> used;
  std::vector<double> cost;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) cost.push_back(mesh_bytes(scales, k, used));
  std::vector<std::size_t> tried;
  for (const double share : kMeshShares) {
    const auto found = std::ranges::find_if(cost, [&](double mesh) { return mesh <= share * all; });
    const auto index = static_cast<std::size_t>(found - cost.begin());
    if (found == cost.end() || std::ranges::find(tried, index) != tried.end()) continue;
    tried.push_back(index);
    const Mesh mesh = lit_scale(scales, index, context);
    const std::vector<RenderTexture> textures = affordable(shown.textures, all - cost[index]);
    const RenderScene scene = render_scene(mesh, shown.materials, textures.size());
    const double rival =
        studio.compare(scene, textures, ProxyStudio::kMiddle, context, kFarOff * flip).mean();
    if (rival <= flip) return true;
    if (rival > kFarOff * flip) return false;
  }
  return false;
}

}  // namespace texmesh::proxies
