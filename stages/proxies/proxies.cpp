#include "stages/proxies/proxies.h"

#include <algorithm>
#include <array>
#include <string>

#include "format/base/box.h"
#include "format/base/portable_math.h"
#include "stages/geometry/scale_frames.h"
#include "stages/geometry/stand_in_scale.h"
#include "stages/proxies/making/make_proxy.h"
#include "stages/proxies/making/nested_rival.h"
#include "stages/proxies/making/smooth_surface.h"

namespace texmesh {
namespace {

using proxies::BakedProxy;
using proxies::BakeSource;
using proxies::find_groups;
using proxies::MadeProxy;
using proxies::MaterialGroups;
using proxies::NestedRivals;
using proxies::ProxyForm;
using proxies::ProxyStudio;
using proxies::ProxyWorkshop;
using proxies::SurfaceLadder;

constexpr std::uint32_t kLeastTriangles = 60;
constexpr double kLeastBytesPerTriangle = 4;
constexpr double kFirstMeshShare = 0.7, kMeshShare = 0.65, kLargeMeshShare = 0.55;
constexpr int kFineFrom = 100000, kNormalMapPaysFrom = 100000;  // bytes
constexpr int kFirstBits = 10, kBits = 11, kFineBits = 12;      // of positions
constexpr double kOverAsked = 1.02, kMostOfSource = 0.15;
// Of the first size: what Draco, which scales are coded by, needs for the same picture.
constexpr double kFirstShare = 0.55;
// What proxies of up to 40,000 triangles and pictures of 512 px need of S_0: at 500,000 the collapses took
// eight times as long.
constexpr std::size_t kMostBaked = 250'000;
constexpr double kFarthestBaked = 2e-4;  // of the diagonal

/// Source textures need not be finer than what a proxy and the pictures show of them.
std::uint32_t least_side_px(const std::vector<Material>& materials) {
  std::size_t used = 0;
  for (const Material& m : materials) for_each_texture(m, [&](const TextureRef& t) { used += t.used(); });
  return used > 64 ? 256 : used > 24 ? 512 : used > 8 ? 1024 : 2048;
}

/// Whether occlusion, roughness and metal are not the same everywhere.
bool data_varies(const std::vector<RenderMaterial>& materials) {
  return std::ranges::any_of(materials, [&](const RenderMaterial& m) {
    const RenderMaterial& other = materials.front();
    return m.slot(TextureUse::kMetallicRoughness).texture >= 0 ||
           m.slot(TextureUse::kOcclusion).texture >= 0 || m.metallic != other.metallic ||
           m.roughness != other.roughness;
  });
}

/// False where viewers read all base colours of the source without mip levels. A proxy read with them would
/// look soft beside it: .060 instead of .043 for a building of 150 kB.
bool reads_mip_levels(const std::vector<Material>& materials) {
  bool without = false, with = false;
  for (const Material& m : materials) {
    const TextureRef& texture = m.base_colour_texture;
    if (!texture.used()) continue;
    const bool level_0 =
        texture.minification == Minification::kLinear || texture.minification == Minification::kNearest;
    (level_0 ? without : with) = true;
  }
  return with || !without;
}

/// What the first try of a size is made of.
ProxyForm first_form(int bytes, bool first, bool data) {
  ProxyForm out;
  out.maps.orm = data;
  out.mesh_share = first ? kFirstMeshShare : bytes < kFineFrom ? kMeshShare : kLargeMeshShare;
  out.coding = {!first, first ? kFirstBits : bytes < kFineFrom ? kBits : kFineBits};
  return out;
}

void note_none(Notes& notes, int bytes, const std::string& why) {
  add_info(notes, "no-proxy", "", "there is no proxy of " + std::to_string(bytes) + " bytes: " + why);
}

Mesh baked_mesh(const NestedScales& scales, const RunContext& context) {
  const double diagonal = bounding_box(scales.mesh.positions).diagonal();
  return lit_scale(scales, stand_in_scale(scales, kMostBaked, kFarthestBaked * diagonal), context);
}

/// What the files of a model that proxies stand for take.
double source_bytes(const NestedScales& scales, const std::vector<Image>& images) {
  double sum = proxies::whole_mesh_bytes(scales);
  for (const Image& image : images) sum += static_cast<double>(image.bytes.size());
  return sum;
}

/// Sizes that are worth a try, rising. The others have a note.
std::vector<int> sizes_to_try(const NestedScales& scales, const std::vector<Image>& images,
                              const ProxiesOptions& options, Notes& notes) {
  if (options.mode == ProxyMode::kAlways) return options.sizes;
  std::vector<int> out;
  double left = kMostOfSource * source_bytes(scales, images);
  for (const int bytes : options.sizes) {
    if (proxies::whole_mesh_is_small(scales, static_cast<std::uint64_t>(bytes))) {
      note_none(notes, bytes, "S_0's mesh takes few of them, so the source's atlas can stay");
    } else if (kOverAsked * bytes > left) {
      note_none(notes, bytes, "proxies take at most 15 % of the source");
    } else {
      left -= kOverAsked * bytes;
      out.push_back(bytes);
    }
  }
  return out;
}

/// One model's proxies, smallest first.
class ProxyRun {
 public:
  ProxyRun(const NestedScales& scales, const Mesh& mesh, const ShownMaterials& shown,
           const BakeSource& source, const MaterialGroups& groups, ProxyMode mode, int most_bytes,
           const RunContext& context)
      : mode_(mode),
        mapped_(std::ranges::any_of(
            shown.materials,
            [](const RenderMaterial& m) { return !m.unlit && m.slot(TextureUse::kNormal).texture >= 0; })),
        data_(data_varies(shown.materials)),
        smooth_(proxies::is_smooth(mesh)),
        surfaces_(mesh, groups, kLeastTriangles, most_triangles(mesh, most_bytes), context),
        shop_(source, groups, surfaces_),
        studio_(mesh, shown),
        rivals_(scales, shown, studio_) {}

  void add(int bytes, Proxies& out, const RunContext& context) {
    const bool first = out.proxies.empty();
    if (whole_) return note_none(out.notes, bytes, kWholeTakesFewer);
    if (!first && cannot_win(bytes, context)) return note_none(out.notes, bytes, kScaleWins);
    Candidate best = best_of(bytes, first, context);
    std::optional<MadeProxy>& made = best.made;
    if (!made) return note_none(out.notes, bytes, "mesh and pictures do not fit");
    whole_ = !first && made->proxy.glb.size() <= out.proxies.back().glb.size();
    if (whole_) return note_none(out.notes, bytes, kWholeTakesFewer);
    last_ = {(first ? kFirstShare : 1) * bytes, best.flip.mean()};
    const bool loses = loses_to_scale(made->proxy.glb.size(), first, best.flip.mean(), context);
    if (loses && !first) return note_none(out.notes, bytes, kScaleWins);
    made->proxy.losses = studio_.losses(made->shown, best.flip, context);
    out.proxies.push_back(std::move(made->proxy));
    if (first) first_loses_ = loses;
  }

  /// A smallest proxy that loses goes with those that it is shown before.
  void finish(Proxies& out) const {
    if (!first_loses_ || out.proxies.size() != 1) return;
    note_none(out.notes, static_cast<int>(out.proxies.front().target_bytes), kScaleWins);
    out.proxies.clear();
  }

 private:
  static constexpr const char* kScaleWins = "a scale with the source's atlas looks better for the same bytes";
  static constexpr const char* kWholeTakesFewer = "the whole object takes fewer";
  struct Candidate {
    std::optional<MadeProxy> made;
    ProxyForm form;
    FlipSum flip;  // at the middle height
  };
  void compete(BakedProxy& baked, std::uint64_t bytes, const ProxyForm& form, Candidate& best,
               const RunContext& context) {
    std::optional<MadeProxy> made = shop_.finish(baked, bytes, form);
    if (!made) return;
    // Facets of a smooth object must be worth it. Another's normals, which stand for its own facets, are to
    // be more than noise.
    const double worth = form.normals ? 1 : smooth_ ? 1.04 : 0.995;
    // After half of the views.
    constexpr double kFarOff = 1.15, kNoise = 0.005;
    const double hopeless = best.made ? kFarOff * best.flip.mean() / worth + kNoise : 1;
    const FlipSum flip = studio_.at_middle(made->shown, context, hopeless);
    if (!best.made || flip.mean() * worth < best.flip.mean()) best = {std::move(made), form, flip};
  }

  bool loses_to_scale(std::uint64_t bytes, bool first, double flip, const RunContext& context) {
    if (mode_ != ProxyMode::kAuto) return false;
    const double rival_bytes = (first ? kFirstShare : 1) * static_cast<double>(bytes);
    return rivals_.win(static_cast<std::uint64_t>(rival_bytes), flip, context);
  }

  /// Whether a scale is farther ahead of the last size than this one can come. FLIP falls with a power of the
  /// bytes: of six scans on average .4, at most .63.
  bool cannot_win(int bytes, const RunContext& context) {
    constexpr double kMostPower = 0.75;
    if (mode_ != ProxyMode::kAuto || !(last_.bytes > 0)) return false;
    const double best = last_.flip * portable::pow(last_.bytes / bytes, kMostPower);
    return rivals_.likeliest_wins(static_cast<std::uint64_t>(bytes), best, context);
  }

  /// FLIP likes facets of a smooth object even where they are large (a bust's .107 for .115 at 20 kB); who
  /// looks at them does not. Small ones are not seen, and the bytes of normals sharpen the textures.
  bool may_be_flat(const BakedProxy& baked, int bytes, bool first) const {
    constexpr std::size_t kSmallFacets = 12000;  // a helmet of 9,000 showed them
    if (!smooth_) return first || flat_;
    return baked.atlas.triangles.size() >= kSmallFacets && (bytes < kFineFrom || flat_);
  }

  /// Normals, flat triangles and a normal map compete on one bake. Where triangles of the first size need no
  /// normals, a second bake has more of them.
  Candidate best_of(int bytes, bool first, const RunContext& context) {
    const auto target = static_cast<std::uint64_t>(bytes);
    Candidate best;
    ProxyForm form = first_form(bytes, first, data_);
    form.maps.normal = mapped_ && bytes >= kNormalMapPaysFrom;
    auto baked = shop_.bake(bytes, form, context);
    if (!baked) return best;
    if (form.maps.normal) compete(*baked, target, form, best, context);
    form.maps.normal = false;
    compete(*baked, target, form, best, context);
    form.normals = false;
    if (may_be_flat(*baked, bytes, first)) compete(*baked, target, form, best, context);
    if (best.made) shop_.learn(*best.made);
    flat_ = best.made && !best.form.normals;
    if (first && flat_)
      if (auto again = shop_.bake(bytes, form, context)) compete(*again, target, form, best, context);
    return best;
  }

  static std::uint32_t most_triangles(const Mesh& mesh, int most_bytes) {
    return static_cast<std::uint32_t>(
        std::min<double>(most_bytes / kLeastBytesPerTriangle, static_cast<double>(mesh.triangles.size())));
  }
  ProxyMode mode_;
  bool mapped_;               // a source material has a normal map
  bool data_;                 // occlusion, roughness or metal need a map
  bool smooth_;               // S_0 shows no facets
  bool flat_ = false;         // the last proxy needs no normals
  bool first_loses_ = false;  // to a scale of as many bytes
  bool whole_ = false;        // the last proxy is all that larger ones could be
  struct {
    double bytes = 0, flip = 0;  // in bytes of Draco
  } last_;                       // size that was made
  SurfaceLadder surfaces_;
  ProxyWorkshop shop_;
  ProxyStudio studio_;
  NestedRivals rivals_;
};

}  // namespace

Proxies make_proxies(const NestedScales& scales, const std::vector<Material>& materials,
                     const std::vector<Image>& images, const Fragments& fragments,
                     const std::vector<Pixels>& pixels, const ProxiesOptions& options,
                     const RunContext& context) {
  Proxies out;
  if (options.mode == ProxyMode::kNone) return out;
  if (scales.scales.empty()) throw StageError("proxies", "scales", "S_0", "none");
  const std::vector<int> sizes = sizes_to_try(scales, images, options, out.notes);
  if (sizes.empty()) return out;
  RunContext inner = context;
  inner.progress = nullptr;
  const Mesh mesh = baked_mesh(scales, inner);
  const ShownMaterials shown =
      shown_materials(materials, fragments, pixels, mesh, least_side_px(materials), inner);
  MaterialGroups groups = find_groups(mesh, shown.materials);
  groups.mip_levels = reads_mip_levels(materials);
  const BakeSource source(mesh, shown, groups);
  if (!(source.diagonal() > 0)) {
    for (const int bytes : sizes) note_none(out.notes, bytes, "the object has no extent");
    return out;
  }
  ProxyRun run(scales, mesh, shown, source, groups, options.mode, sizes.back(), inner);
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    run.add(sizes[i], out, inner);
    context.report(static_cast<double>(i + 1) / static_cast<double>(sizes.size()));
  }
  run.finish(out);
  return out;
}

}  // namespace texmesh
