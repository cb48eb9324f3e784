#include "stages/proxies/proxies.h"

#include "format/base/portable_math.h"
#include "stages/proxies/whole_scale.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kLeastTriangles = 60;
constexpr double kLeastBytesPerTriangle = 4;
constexpr double kFirstMeshShare = 0.7, kMeshShare = 0.65, kLargeMeshShare = 0.55;
constexpr int kFineFrom = 100000, kNormalMapPaysFrom = 100000;  // bytes
// Bytes from which on scales are tried: all sizes but the first, which needs no decoder. Of a few large
// charts a scale is nearer from there on (a yurt's .060 for .100 in a plan of 100 kB); of the saxophone's
// 2,242 from 450 kB on (.033 for .047), and of a site without mip levels what is baked is nearer for longer.
constexpr int kScaleFrom = 40000;
constexpr int kFirstBits = 10, kBits = 11, kFineBits = 12;  // of positions
constexpr double kMostOfSource = 0.4;
constexpr double kWorthIts = 0.9;  // of the FLIP of the proxy before: what a scale is kept for
// Of the smallest size: what is loaded soon needs no other first picture.
constexpr double kMostOfSmallSource = 0.15;
// Of the first size: what Draco, which scales are coded by, needs for the same picture.
constexpr double kFirstShare = 0.55;
// What proxies of up to 40,000 triangles and pictures of 512 px need of S_0: at 500,000 the collapses took
// eight times as long.
constexpr std::size_t kMostBaked = 250'000;
constexpr double kFarthestBaked = 2e-4;  // of the diagonal

/// Whether occlusion, roughness and metal are not the same everywhere.
bool data_varies(const std::vector<RenderMaterial>& materials) {
  return std::ranges::any_of(materials, [&](const RenderMaterial& m) {
    const RenderMaterial& other = materials.front();
    return m.slot(TextureUse::kMetallicRoughness).texture >= 0 ||
           m.slot(TextureUse::kOcclusion).texture >= 0 || m.metallic != other.metallic ||
           m.roughness != other.roughness;
  });
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

constexpr const char* kScaleWins = "a scale with the source's atlas looks better for the same bytes";
constexpr const char* kWholeTakesFewer = "the whole object takes fewer";
constexpr const char* kDoNotFit = "mesh and pictures do not fit";
constexpr const char* kLittleBetter = "it would look little better than the proxy before it";
constexpr const char* kOfSource = "proxies take at most 40 % of the source";
constexpr const char* kSmallSource = "the smallest proxy would take more than 15 % of the source";

std::uint32_t most_triangles(const Mesh& mesh, int most_bytes) {
  return static_cast<std::uint32_t>(
      std::min<double>(most_bytes / kLeastBytesPerTriangle, static_cast<double>(mesh.triangles.size())));
}

/// The scale that is baked: S_0, or what stands for it.
std::size_t baked_scale(const NestedScales& scales) {
  return stand_in_scale(scales, kMostBaked, kFarthestBaked * bounding_box(scales.mesh.positions).diagonal());
}

/// What the files of a model that proxies stand for take.
double source_bytes(const NestedScales& scales, const std::vector<Image>& images) {
  double sum = whole_mesh_bytes(scales);
  for (const Image& image : images) sum += static_cast<double>(image.bytes.size());
  return sum;
}

/// Sizes that are worth a try, rising. The others have a note.
std::vector<int> sizes_to_try(const NestedScales& scales, const std::vector<Image>& images,
                              const ProxiesOptions& options, Notes& notes) {
  if (options.mode == ProxyMode::kAlways) return options.sizes;
  std::vector<int> out;
  const bool is_small =
      kOverAsked * options.sizes.front() > kMostOfSmallSource * source_bytes(scales, images);
  for (const int bytes : options.sizes) {
    if (is_small)
      note_none(notes, bytes, kSmallSource);
    else if (out.empty() && whole_mesh_is_small(scales, static_cast<std::uint64_t>(bytes)))
      note_none(notes, bytes, "S_0's mesh takes few of them, so the source's atlas can stay");
    else
      out.push_back(bytes);
  }
  return out;
}

/// What the sizes that stay may take.
double most_bytes(const NestedScales& scales, const std::vector<Image>& images, ProxyMode mode) {
  return mode == ProxyMode::kAlways ? std::numeric_limits<double>::infinity()
                                    : kMostOfSource * source_bytes(scales, images);
}

/// What every size is made of, and how the model looks. Constant once made.
struct ProxySubject {
  const Mesh& mesh;  // S_0, or what stands for it
  const ShownMaterials& shown;
  const MaterialGroups& groups;
  const BakeSource& source;
  ProxyMode mode;
  double most_bytes;  // of all proxies
  bool mapped;        // a source material has a normal map
  bool varied;        // occlusion, roughness or metal need a map
  bool smooth;        // S_0 shows no facets
};

ProxySubject subject_of(const Mesh& mesh, const ShownMaterials& shown, const MaterialGroups& groups,
                        const BakeSource& source, ProxyMode mode, double most_bytes) {
  const bool mapped = std::ranges::any_of(shown.materials, [](const RenderMaterial& m) {
    return !m.unlit && m.slot(TextureUse::kNormal).texture >= 0;
  });
  return {mesh,           shown, groups, source, mode, most_bytes, mapped, data_varies(shown.materials),
          is_smooth(mesh)};
}

/// What the sizes so far tell the next one.
struct Learned {
  ProxyCosts costs;
  bool flat = false;                // the last proxy needs no normals
  bool map_lost = false;            // a normal map plainly, at the last size that has tried one
  int picture_quality = 0;          // of the last proxy, 0 = not known
  double last_bytes = 0;            // of the last size that was baked, in bytes of Draco
  double last_flip = 0;             // its loss
  double all_bytes = 0;             // of those that stay
  bool smallest_loses = false;      // to a scale of as many bytes
  RivalPrices prices;               // of scales
  bool holds_whole_object = false;  // the last proxy is all that larger ones could be
};

/// What a proxy is. No plan of its bytes is nearer than a scale's file, or than what has beaten that.
enum class ProxyKind { kBaked, kBakedBeatsScale, kScale };

/// A proxy of one size, in the form that looks best so far.
struct Candidate {
  std::optional<MadeProxy> made;
  ProxyForm form;
  FlipSum flip;  // at the middle height
  ProxyKind kind = ProxyKind::kBaked;
  std::optional<FlipSum> large;
};

/// Takes the place of `best` where it looks better, worth its form.
void compete(const ProxySubject& subject, const ReferenceViews& views, BakedProxy& baked, std::uint64_t bytes,
             const ProxyForm& form, Candidate& best, const RunContext& context) {
  std::optional<MadeProxy> made = finish_proxy(baked, subject.groups, bytes, form);
  if (!made) return;
  // Facets of a smooth object must be worth it. Another's normals, which stand for its own facets, are to
  // be more than noise.
  const double worth = form.normals ? 1 : subject.smooth ? 1.04 : 0.995;
  // After half of the views.
  constexpr double kFarBehind = 1.15, kNoise = 0.005;
  const double hopeless = best.made ? kFarBehind * best.flip.mean() / worth + kNoise : 1;
  const FlipSum flip =
      picture_loss(views, made->shown.scene(), made->shown.shown.textures, context, hopeless);
  if (!best.made || flip.mean() * worth < best.flip.mean())
    best = {std::move(made), form, flip, ProxyKind::kBaked, {}};
}

/// FLIP likes facets of a smooth object even where they are large (a bust's .107 for .115 at 20 kB); who
/// looks at them does not. Small ones are not seen, and the bytes of normals sharpen the textures.
bool may_be_flat(const ProxySubject& subject, const BakedProxy& baked, int bytes, bool first,
                 bool last_flat) {
  constexpr std::size_t kSmallFacets = 12000;  // a helmet of 9,000 showed them
  if (!subject.smooth) return first || last_flat;
  return baked.atlas.triangles.size() >= kSmallFacets && (bytes < kFineFrom || last_flat);
}

/// Normals, flat triangles and a normal map compete on one bake. Where triangles of the first size need no
/// normals, a second bake has more of them.
Candidate best_of(const ProxySubject& subject, const ReferenceViews& views, CoarseSurfaces& surfaces,
                  int bytes, bool first, Learned& learned, const RunContext& context) {
  Candidate best;
  ProxyForm form = first_form(bytes, first, subject.varied);
  const auto bake = [&] {
    auto made = bake_proxy(subject.source, subject.groups, surfaces, learned.costs, bytes, form, context);
    if (made) made->pictures.last_quality = learned.picture_quality;
    return made;
  };
  const auto try_form = [&](BakedProxy& baked) {
    compete(subject, views, baked, static_cast<std::uint64_t>(bytes), form, best, context);
  };
  form.maps.normal = subject.mapped && bytes >= kNormalMapPaysFrom && !learned.map_lost;
  auto baked = bake();
  if (!baked) return best;
  double with_map = 0;
  if (form.maps.normal) try_form(*baked), with_map = best.flip.mean();
  form.maps.normal = false;
  try_form(*baked);
  form.normals = false;
  if (may_be_flat(subject, *baked, bytes, first, learned.flat)) try_form(*baked);
  if (best.made)
    if (const auto bits = texel_bits_of(*best.made)) learned.costs.texel_bits = *bits;
  learned.flat = best.made && !best.form.normals;
  constexpr double kClearly = 0.99;
  if (best.made) learned.picture_quality = best.made->quality;
  if (with_map > 0 && best.flip.mean() < kClearly * with_map) learned.map_lost = true;
  if (first && learned.flat)
    if (auto again = bake()) try_form(*again);
  return best;
}

/// Whether a scale is farther ahead of the last size than this one can come. FLIP falls with a power of the
/// bytes: of six scans on average .4, at most .63.
bool cannot_win(CompetingScales& scales, int bytes, const Learned& learned, const RunContext& context) {
  constexpr double kMostPower = 0.75;
  if (!(learned.last_bytes > 0)) return false;
  const double best = learned.last_flip * portable::pow(learned.last_bytes / bytes, kMostPower);
  return scales.likeliest_wins(static_cast<std::uint64_t>(bytes), best, learned.prices, context);
}

/// A proxy that stays, with its losses at two heights.
struct KeptProxy {
  MadeProxy made;
  FlipSum middle, large;
  ProxyKind kind;
};

/// Tries one size after the other, smallest first.
class ProxySizes {
 public:
  ProxySizes(const ProxySubject& subject, const WholeScaleSource& source, const std::vector<int>& sizes,
             const RunContext& context)
      : subject_(subject),
        context_(context),
        surfaces_(subject.mesh, subject.groups, kLeastTriangles, most_triangles(subject.mesh, sizes.back()),
                  context),
        middle_(reference_views(subject.mesh, subject.shown, kMiddlePx, context)),
        large_(reference_views(subject.mesh, subject.shown, kLargePx, context, 2)),
        scales_(source, sizes.back()),
        competitors_(source.scales, subject.shown, middle_) {}

  ProxySizes(const ProxySizes&) = delete;
  ProxySizes& operator=(const ProxySizes&) = delete;

  /// Why the size gets no proxy; null where it does.
  const char* add(int bytes);
  /// Proxies that stay. A smallest one that loses goes with those that it is shown before.
  std::vector<KeptProxy> kept(Notes& notes) &&;

 private:
  FlipSum flip_of(const MadeProxy& made, const ReferenceViews& views) const {
    return picture_loss(views, made.shown.scene(), made.shown.shown.textures, context_);
  }
  Candidate best_candidate(int bytes);
  bool is_nearer(const Candidate& a, const Candidate& b);
  const char* why_not(const Candidate& best, const FlipSum& large);
  bool scales_compete() const { return subject_.mode == ProxyMode::kAuto; }

  const ProxySubject& subject_;
  const RunContext& context_;
  CoarseSurfaces surfaces_;
  const ReferenceViews middle_, large_;        // large ones of half of the rows
  std::optional<ReferenceViews> whole_large_;  // where these leave doubt
  WholeScales scales_;
  CompetingScales competitors_;
  std::vector<KeptProxy> kept_;
  Learned learned_;
};

/// A scale or baked, by pictures in which both show their texels. Bakes only what may be nearer: FLIP of six
/// scans' proxies falls with the power .4 of the bytes, seldom more than this one. Behind a scale it is never
/// nearer, and nothing is baked where a scale in a plan is farther ahead.
Candidate ProxySizes::best_candidate(int bytes) {
  constexpr double kMostPower = 0.5;
  const bool first = kept_.empty();
  Candidate scale;
  try {
    if (bytes >= kScaleFrom && !first) scale.made = scales_.of(static_cast<std::uint64_t>(bytes), context_);
  } catch (const StageError&) {  // what no grid holds, or Draco refuses, is baked
  }
  if (scale.made) {
    scale.kind = ProxyKind::kScale;
    scale.flip = flip_of(*scale.made, middle_);
    const double baked = learned_.last_flip * portable::pow(learned_.last_bytes / bytes, kMostPower);
    if (kept_.back().kind == ProxyKind::kScale || baked > scale.flip.mean()) return scale;
  }
  if (!scale.made && !first && scales_compete() && cannot_win(competitors_, bytes, learned_, context_))
    return {};
  Candidate baked = best_of(subject_, middle_, surfaces_, bytes, first, learned_, context_);
  if (!baked.made) return scale;
  learned_.last_bytes = (first ? kFirstShare : 1) * bytes, learned_.last_flip = baked.flip.mean();
  if (!scale.made) return baked;
  baked.kind = ProxyKind::kBakedBeatsScale;
  scale.large = flip_of(*scale.made, large_), baked.large = flip_of(*baked.made, large_);
  return is_nearer(scale, baked) ? std::move(scale) : std::move(baked);
}

/// By middle and large pictures, by whole large ones where halves of them leave doubt.
bool ProxySizes::is_nearer(const Candidate& a, const Candidate& b) {
  constexpr double kPlainly = 1.1, kLeast = 1e-9;
  const double of_middle = (a.flip.mean() + kLeast) / (b.flip.mean() + kLeast);
  const double ratio = of_middle * (a.large->mean() + kLeast) / (b.large->mean() + kLeast);
  if (std::max(ratio, 1 / ratio) >= kPlainly) return ratio < 1;
  if (!whole_large_) whole_large_ = reference_views(subject_.mesh, subject_.shown, kLargePx, context_);
  return of_middle * flip_of(*a.made, *whole_large_).mean() < flip_of(*b.made, *whole_large_).mean();
}

/// Why the candidate does not stay; null where it does. Plans code a scale's texels apart and pay for tables,
/// so no plan of the bytes shows what a file of a scale shows.
const char* ProxySizes::why_not(const Candidate& best, const FlipSum& large) {
  const bool first = kept_.empty();
  const auto size = static_cast<double>(best.made->proxy.glb.size());
  if (!first && size <= static_cast<double>(kept_.back().made.proxy.glb.size())) {
    const auto is_scale = [](ProxyKind kind) { return kind == ProxyKind::kScale; };
    learned_.holds_whole_object = is_scale(kept_.back().kind) == is_scale(best.kind);
    return kWholeTakesFewer;
  }
  if (!scales_compete()) return nullptr;
  if (best.kind != ProxyKind::kBaked)
    return large.mean() > kWorthIts * kept_.back().large.mean() ? kLittleBetter : nullptr;
  const auto rival_bytes = static_cast<std::uint64_t>((first ? kFirstShare : 1) * size);
  const bool loses = competitors_.win(rival_bytes, best.flip.mean(), learned_.prices, context_);
  if (first) learned_.smallest_loses = loses;
  // Where the smallest one loses, larger ones must be worth its bytes, too.
  if (first && !loses) learned_.prices = competitors_.prices_in_plans();
  return loses && !first ? kScaleWins : nullptr;
}

const char* ProxySizes::add(int bytes) {
  if (learned_.holds_whole_object) return kWholeTakesFewer;
  if (learned_.all_bytes + kOverAsked * bytes > subject_.most_bytes) return kOfSource;
  Candidate best = best_candidate(bytes);
  if (!best.made) return kept_.empty() || !scales_compete() ? kDoNotFit : kScaleWins;
  FlipSum large = best.large ? std::move(*best.large) : flip_of(*best.made, large_);
  if (const char* why = why_not(best, large)) return why;
  learned_.all_bytes += static_cast<double>(best.made->proxy.glb.size());
  kept_.push_back({std::move(*best.made), best.flip, std::move(large), best.kind});
  return nullptr;
}

std::vector<KeptProxy> ProxySizes::kept(Notes& notes) && {
  if (learned_.smallest_loses && kept_.size() == 1) {
    note_none(notes, static_cast<int>(kept_.front().made.proxy.target_bytes), kScaleWins);
    kept_.clear();
  }
  return std::move(kept_);
}

/// The proxies with their losses at all displayed heights.
std::vector<Proxy> measured_proxies(const ProxySubject& subject, std::vector<KeptProxy> kept,
                                    const RunContext& context) {
  std::vector<Proxy> out;
  for (KeptProxy& k : kept) out.push_back(std::move(k.made.proxy));
  ReferenceViews small, huge;
  if (!kept.empty()) {
    small = reference_views(subject.mesh, subject.shown, kSmallPx, context, 2);
    huge = reference_views(subject.mesh, subject.shown, kHugePx, context, 4);
  }
  for (std::size_t i = 0; i < kept.size(); ++i) {
    const ShownModel& shown = kept[i].made.shown;
    const auto flip_in = [&](const ReferenceViews& views) {
      return picture_loss(views, shown.scene(), shown.shown.textures, context);
    };
    const std::array<std::pair<double, FlipSum>, 4> sums{{{kSmallPx, flip_in(small)},
                                                          {kMiddlePx, kept[i].middle},
                                                          {kLargePx, kept[i].large},
                                                          {kHugePx, flip_in(huge)}}};
    for (const auto& [px, flip] : sums) out[i].losses.push_back({px, flip.mean(), flip.percentile(0.95)});
  }
  return out;
}

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
  const std::size_t baked = baked_scale(scales);
  const Mesh mesh = lit_scale(scales, baked, inner);
  const ShownMaterials shown =
      shown_materials(materials, fragments, pixels, mesh, enough_side_px(materials), inner);
  MaterialGroups groups = find_groups(mesh, shown.materials);
  groups.mip_levels = reads_mip_levels(materials);
  const BakeSource source(mesh, shown, groups);
  if (!(source.diagonal() > 0)) {
    for (const int bytes : sizes) note_none(out.notes, bytes, "the object has no extent");
    return out;
  }
  const ProxySubject subject =
      subject_of(mesh, shown, groups, source, options.mode, most_bytes(scales, images, options.mode));
  ProxySizes tried(subject, {scales, materials, images, mesh, baked, shown}, sizes, inner);
  // A size takes about as long as its square root says; pictures of those that stay come after them.
  constexpr double kForSizes = .9;
  double done = 0, all = 0;
  for (const int bytes : sizes) all += std::sqrt(bytes);
  for (const int bytes : sizes) {
    if (const char* why = tried.add(bytes)) note_none(out.notes, bytes, why);
    done += std::sqrt(bytes);
    context.report(kForSizes * done / all);
  }
  out.proxies = measured_proxies(subject, std::move(tried).kept(out.notes), inner);
  return out;
}

}  // namespace texmesh
