#include "stages/proxies/proxies.h"

#include <algorithm>
#include <array>
#include <string>

#include "stages/proxies/making/make_proxy.h"

namespace texmesh {
namespace {

using proxies::BakeSource;
using proxies::ByteSplit;
using proxies::find_groups;
using proxies::MadeProxy;
using proxies::MaterialGroups;
using proxies::ProxyStudio;
using proxies::ProxyWorkshop;
using proxies::SurfaceLadder;

constexpr std::uint32_t kLeastTriangles = 60;
constexpr double kLeastBytesPerTriangle = 4;

/// Source textures need not be finer than what a proxy and the pictures show of them.
std::uint32_t least_side_px(const std::vector<Material>& materials) {
  std::size_t used = 0;
  for (const Material& m : materials) for_each_texture(m, [&](const TextureRef& t) { used += t.used(); });
  return used > 64 ? 256 : used > 24 ? 512 : used > 8 ? 1024 : 2048;
}

ByteSplit split_for(int bytes) {
  constexpr int kMapsPayFrom = 45000;
  ByteSplit out;
  out.maps.normal = out.maps.orm = bytes >= kMapsPayFrom;
  out.mesh_share = 0.6;
  return out;
}

void note_none(Notes& notes, int bytes, const std::string& why) {
  add_info(notes, "no-proxy", "", "there is no proxy of " + std::to_string(bytes) + " bytes: " + why);
}

}  // namespace

Proxies make_proxies(const NestedScales& scales, const std::vector<Material>& materials,
                     const Fragments& fragments, const std::vector<Pixels>& pixels,
                     const ProxiesOptions& options, const RunContext& context) {
  Proxies out;
  if (options.mode == ProxyMode::kNone || options.sizes.empty()) return out;
  if (scales.scales.empty()) throw StageError("proxies", "scales", "S_0", "none");
  RunContext inner = context;
  inner.progress = nullptr;
  const Mesh mesh = extract_scale(scales, scales.scales.front());
  const ShownMaterials shown =
      shown_materials(materials, fragments, pixels, mesh, least_side_px(materials), inner);
  const MaterialGroups groups = find_groups(mesh, shown.materials);
  const BakeSource source(mesh, shown, groups);
  if (!(source.diagonal() > 0)) {
    add_info(out.notes, "no-proxy", "", "there is no proxy: the object has no extent");
    return out;
  }
  const double most = options.sizes.back() / kLeastBytesPerTriangle;
  SurfaceLadder surfaces(mesh, groups, kLeastTriangles,
                         static_cast<std::uint32_t>(std::min<double>(most, mesh.triangles.size())), inner);
  ProxyWorkshop shop{source, groups, surfaces};
  ProxyStudio studio(mesh, shown, inner);
  for (std::size_t i = 0; i < options.sizes.size(); ++i) {
    const int bytes = options.sizes[i];
    std::optional<MadeProxy> made = shop.make(static_cast<std::uint64_t>(bytes), split_for(bytes), inner);
    if (!made) {
      note_none(out.notes, bytes, "mesh and pictures do not fit");
    } else if (!out.proxies.empty() && made->proxy.glb.size() <= out.proxies.back().glb.size()) {
      note_none(out.notes, bytes, "the whole object takes fewer");
    } else {
      made->proxy.losses = studio.losses(made->shown, inner);
      out.proxies.push_back(std::move(made->proxy));
    }
    context.report(static_cast<double>(i + 1) / static_cast<double>(options.sizes.size()));
  }
  return out;
}

}  // namespace texmesh
