#include "stages/proxies/proxies.h"

#include <algorithm>
#include <array>
#include <string>

#include "stages/proxies/making/make_proxy.h"
#include "stages/proxies/making/nested_rival.h"

namespace texmesh {
namespace {

using proxies::BakedProxy;
using proxies::BakeSource;
using proxies::find_groups;
using proxies::MadeProxy;
using proxies::MaterialGroups;
using proxies::ProxyForm;
using proxies::ProxyStudio;
using proxies::ProxyWorkshop;
using proxies::SurfaceLadder;

constexpr std::uint32_t kLeastTriangles = 60;
constexpr double kLeastBytesPerTriangle = 4;
constexpr double kFirstMeshShare = 0.7, kMeshShare = 0.65, kLargeMeshShare = 0.55;
constexpr int kFineFrom = 100000, kNormalMapPaysFrom = 100000;  // bytes

/// Source textures need not be finer than what a proxy and the pictures show of them.
std::uint32_t least_side_px(const std::vector<Material>& materials) {
  std::size_t used = 0;
  for (const Material& m : materials) for_each_texture(m, [&](const TextureRef& t) { used += t.used(); });
  return used > 64 ? 256 : used > 24 ? 512 : used > 8 ? 1024 : 2048;
}

/// What the first try of a size is made of.
ProxyForm first_form(int bytes, bool first) {
  ProxyForm out;
  out.maps.orm = true;
  out.mesh_share = first ? kFirstMeshShare : bytes < kFineFrom ? kMeshShare : kLargeMeshShare;
  out.coding = {!first, bytes < kFineFrom ? 11 : 12};
  return out;
}

void note_none(Notes& notes, int bytes, const std::string& why) {
  add_info(notes, "no-proxy", "", "there is no proxy of " + std::to_string(bytes) + " bytes: " + why);
}

/// One model's proxies, smallest first.
class ProxyRun {
 public:
  ProxyRun(const NestedScales& scales, const Mesh& mesh, const ShownMaterials& shown,
           const BakeSource& source, const MaterialGroups& groups, const ProxiesOptions& options,
           const RunContext& context)
      : scales_(scales),
        shown_(shown),
        mode_(options.mode),
        mapped_(std::ranges::any_of(
            shown.materials,
            [](const RenderMaterial& m) { return !m.unlit && m.slot(TextureUse::kNormal).texture >= 0; })),
        surfaces_(mesh, groups, kLeastTriangles, most_triangles(mesh, options), context),
        shop_(source, groups, surfaces_),
        studio_(mesh, shown, context) {}

  /// Whether larger sizes are worth a try.
  bool add(int bytes, Proxies& out, const RunContext& context) {
    Candidate best = best_of(bytes, out.proxies.empty(), context);
    std::optional<MadeProxy>& made = best.made;
    if (!made) {
      note_none(out.notes, bytes, "mesh and pictures do not fit");
      return true;
    }
    if (!out.proxies.empty() && made->proxy.glb.size() <= out.proxies.back().glb.size()) {
      note_none(out.notes, bytes, "the whole object takes fewer");
      return false;
    }
    made->proxy.losses = studio_.losses(made->shown, best.flip, context);
    if (mode_ == ProxyMode::kAuto) {
      const auto rival = rival_flip(scales_, shown_, made->proxy.glb.size(), studio_, context);
      if (rival && *rival <= made->proxy.losses[ProxyStudio::kMiddle].flip_mean) {
        note_none(out.notes, bytes,
                  "a scale with the source's atlas looks better for the same bytes, and for more bytes, too");
        return false;
      }
    }
    out.proxies.push_back(std::move(made->proxy));
    return true;
  }

 private:
  struct Candidate {
    std::optional<MadeProxy> made;
    ProxyForm form;
    FlipSum flip;  // at the middle height
  };
  void compete(const BakedProxy& baked, std::uint64_t bytes, const ProxyForm& form, Candidate& best,
               const RunContext& context) {
    std::optional<MadeProxy> made = shop_.finish(baked, bytes, form);
    if (!made) return;
    const FlipSum flip = studio_.at_middle(made->shown, context);
    if (!best.made || flip.mean() < best.flip.mean()) best = {std::move(made), form, flip};
  }

  /// Normals, flat triangles and a normal map compete on one bake. Where triangles of the first size need no
  /// normals, a second bake has more of them.
  Candidate best_of(int bytes, bool first, const RunContext& context) {
    const auto target = static_cast<std::uint64_t>(bytes);
    Candidate best;
    ProxyForm form = first_form(bytes, first);
    const auto baked = shop_.bake(bytes, form, context);
    if (!baked) return best;
    if (mapped_ && bytes >= kNormalMapPaysFrom) {
      ProxyForm mapped = form;
      mapped.maps.normal = true;
      compete(*baked, target, mapped, best, context);
    }
    compete(*baked, target, form, best, context);
    form.normals = false;
    if (first || flat_) compete(*baked, target, form, best, context);
    if (best.made) shop_.learn(best.made->quality);
    flat_ = best.made && !best.form.normals;
    if (first && flat_)
      if (const auto again = shop_.bake(bytes, form, context)) compete(*again, target, form, best, context);
    return best;
  }

  static std::uint32_t most_triangles(const Mesh& mesh, const ProxiesOptions& options) {
    return static_cast<std::uint32_t>(std::min<double>(options.sizes.back() / kLeastBytesPerTriangle,
                                                       static_cast<double>(mesh.triangles.size())));
  }
  const NestedScales& scales_;
  const ShownMaterials& shown_;
  ProxyMode mode_;
  bool mapped_;        // a source material has a normal map
  bool flat_ = false;  // the last proxy needs no normals
  SurfaceLadder surfaces_;
  ProxyWorkshop shop_;
  ProxyStudio studio_;
};

}  // namespace

Proxies make_proxies(const NestedScales& scales, const std::vector<Material>& materials,
                     const Fragments& fragments, const std::vector<Pixels>& pixels,
                     const ProxiesOptions& options, const RunContext& context) {
  Proxies out;
  if (options.mode == ProxyMode::kNone || options.sizes.empty()) return out;
  if (scales.scales.empty()) throw StageError("proxies", "scales", "S_0", "none");
  if (options.mode == ProxyMode::kAuto &&
      proxies::whole_mesh_is_small(scales, static_cast<std::uint64_t>(options.sizes.front()))) {
    note_none(out.notes, options.sizes.front(),
              "S_0's mesh takes few of them, so the source's atlas can stay");
    return out;
  }
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
  ProxyRun run(scales, mesh, shown, source, groups, options, inner);
  for (std::size_t i = 0; i < options.sizes.size(); ++i) {
    // An atlas of its own pays less the more bytes there are: .6 of the source atlas' FLIP at 20 kB, .8 at
    // 150 kB, more than 1 from 250 kB on (two prototypes). Where it has lost, larger proxies are not tried.
    if (!run.add(options.sizes[i], out, inner)) break;
    context.report(static_cast<double>(i + 1) / static_cast<double>(options.sizes.size()));
  }
  return out;
}

}  // namespace texmesh
