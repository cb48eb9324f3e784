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

std::size_t kept_from(const RenderTexture& texture, std::size_t dropped) {
  return std::min(dropped, texture.levels.size() - 1);
}

/// How many of their finest levels textures are shown without, so that the others cost no more.
std::size_t affordable(const std::vector<RenderTexture>& textures, double bytes) {
  for (std::size_t dropped = 0;; ++dropped) {
    double texels = 0;
    bool coarser = false;
    for (const RenderTexture& t : textures) {
      const Pixels& level = t.levels[kept_from(t, dropped)];
      texels += static_cast<double>(level.width_px) * level.height_px;
      coarser = coarser || dropped + 1 < t.levels.size();
    }
    if (texels * kBitsPerTexel / 8 <= bytes || !coarser) return dropped;
  }
}

std::vector<RenderTexture> without_finest(const std::vector<RenderTexture>& textures, std::size_t dropped) {
  std::vector<RenderTexture> out;
  for (const RenderTexture& t : textures) {
    const std::size_t from = kept_from(t, dropped);
    out.push_back({t.width_px,
                   t.height_px,
                   t.srgb,
                   t.first_level + static_cast<std::uint32_t>(from),
                   {t.levels.begin() + static_cast<std::ptrdiff_t>(from), t.levels.end()}});
  }
  return out;
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

NestedRivals::NestedRivals(const NestedScales& scales, const ShownMaterials& shown, ProxyStudio& studio)
    : scales_(scales), shown_(shown), studio_(studio) {
  std::vector<std::uint8_t> used;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) mesh_bytes_.push_back(mesh_bytes(scales, k, used));
}

/// The likeliest winners first.
std::vector<NestedRivals::Rival> NestedRivals::rivals(std::uint64_t bytes) const {
  const double all = std::max(0.0, static_cast<double>(bytes) - kFrameBytes -
                                       kPictureBytes * static_cast<double>(shown_.textures.size()));
  std::vector<Rival> out;
  for (const double share : kMeshShares) {
    const auto found = std::ranges::find_if(mesh_bytes_, [&](double mesh) { return mesh <= share * all; });
    const auto index = static_cast<std::size_t>(found - mesh_bytes_.begin());
    if (found != mesh_bytes_.end() && std::ranges::find(out, index, &Rival::scale) == out.end())
      out.push_back({index, affordable(shown_.textures, all - mesh_bytes_[index])});
  }
  return out;
}

/// Of half of the views where that is far more than `flip`.
double NestedRivals::flip_of(const Rival& rival, double flip, const RunContext& context) {
  if (const auto found = known_.find(rival); found != known_.end()) return found->second;
  const Mesh mesh = lit_scale(scales_, rival.scale, context);
  const std::vector<RenderTexture> textures = without_finest(shown_.textures, rival.dropped_levels);
  const RenderScene scene = render_scene(mesh, shown_.materials, textures.size());
  const double out = studio_.compare(scene, textures, ProxyStudio::kMiddle, context, kFarOff * flip).mean();
  if (out <= kFarOff * flip) known_[rival] = out;
  return out;
}

bool NestedRivals::win(std::uint64_t bytes, double flip, const RunContext& context) {
  for (const Rival& rival : rivals(bytes)) {
    const double its_flip = flip_of(rival, flip, context);
    if (its_flip <= flip) return true;
    if (its_flip > kFarOff * flip) return false;
  }
  return false;
}

bool NestedRivals::likeliest_wins(std::uint64_t bytes, double flip, const RunContext& context) {
  const std::vector<Rival> all = rivals(bytes);
  return !all.empty() && flip_of(all.front(), flip, context) <= flip;
}

}  // namespace texmesh::proxies
