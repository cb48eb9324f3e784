#include "delivery/cpp/decide/texture_budget.h"

#include "format/base/portable_math.h"
#include "format/rules/allocation.h"

namespace texmesh {
namespace {

constexpr double kMeshShare = 0.5;  // a mesh may take so much where a coarser one takes less
constexpr std::uint64_t kVertexBytes = 4 * (3 + 3 + 2 + 4), kTriangleBytes = 3 * 4, kProxyTextures = 4;

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

constexpr double kWorthwhileFlip = 2e-3;      // that finer planes must save: nobody sees less
constexpr double kWorthwhilePart = 1.0 / 16;  // where little is lost: so much of it
constexpr int kReweightings = 2;
constexpr double kLossUnit = 1099511627776.0;  // 2^40: losses as spend_bytes counts them
constexpr double kLeastWeight = 1e-3;          // of a group beside the others

using Levels = std::array<int, kPlaneGroups>;

/// Spends the bytes on these planes.
TextureBudget spend_on(TextureLoss& loss, std::vector<PlaneChoice> planes, const ListOptions& options,
                       std::uint64_t bytes) {
  TextureBudget out;
  out.list = fragment_list(loss, planes, options);
  std::vector<RdCurve> curves;
  for (const FragmentOffer& f : out.list.offers) {
    RdCurve curve{{0}, {}};
    curve.bytes.insert(curve.bytes.end(), f.bytes.begin(), f.bytes.end());
    for (const double l : f.loss) curve.loss.push_back(static_cast<std::uint64_t>(l * kLossUnit));
    curves.push_back(std::move(curve));
  }
  const std::vector<std::uint32_t> ways = spend_bytes(curves, bytes);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    out.rungs.push_back(static_cast<std::int32_t>(ways[i]) - 1);
    out.bytes += curves[i].bytes[ways[i]];
  }
  out.losses = losses_of(out.list, out.rungs);
  out.flip = picture_flip(loss.package().quality(), options.displayed_px, options.scale, out.losses);
  out.planes = std::move(planes);
  return out;
}

/// The slopes of the predicted FLIP by the groups' losses.
PerGroup slopes(const QualityTable& table, const TextureBudget& at) {
  PerGroup slopes{1, 1, 1};
  for (std::size_t g = 0; g < kPlaneGroups; ++g)
    if (at.flip > 0)
      slopes[g] = std::max(kLeastWeight, portable::pow(std::max(at.losses[g] / at.flip, 1e-9),
                                                       static_cast<double>(table.exponent) - 1));
  return slopes;
}

/// One level coarser, of all groups together, then of each; then one level finer.
std::vector<Levels> level_steps() {
  std::vector<Levels> steps;
  for (const int by : {1, -1}) {
    steps.push_back({by, by, by});
    for (std::size_t g = 0; g < kPlaneGroups; ++g) steps.push_back({}), steps.back()[g] = by;
  }
  return steps;
}

/// Looks for the levels whose planes look best. Levels beyond the ladder's ends, and those of groups that the
/// package does not have, stand for planes that were tried.
class LevelSearch {
 public:
  LevelSearch(TextureLoss& loss, const ListOptions& options, std::uint64_t bytes)
      : loss_(loss), options_(options), bytes_(bytes) {
    best_ = *spend({});
  }

  /// Downhill: the best of all steps, until none is better.
  TextureBudget find() {
    const std::vector<Levels> steps = level_steps();
    for (bool better = true; better;) {
      better = false;
      const Levels from = at_;
      without_finer_ = best_.flip;
      for (const Levels& step : steps) better = take(from, step) || better;
    }
    return std::move(best_);
  }

 private:
  bool take(const Levels& from, const Levels& step) {
    Levels to = from;
    for (std::size_t g = 0; g < kPlaneGroups; ++g) to[g] += step[g];
    std::optional<TextureBudget> now = spend(to);
    if (!now || now->flip >= best_.flip) return false;
    const bool is_finer = std::ranges::min(step) < 0;
    // Beside each other, finer planes need not save that much.
    const double least = std::min(kWorthwhileFlip, kWorthwhilePart * without_finer_);
    if (is_finer && now->flip >= without_finer_ - least) return false;
    best_ = std::move(*now);
    at_ = to;
    if (!is_finer) without_finer_ = best_.flip;
    return true;
  }
  /// Nothing where these planes were tried.
  std::optional<TextureBudget> spend(const Levels& levels) {
    std::vector<PlaneChoice> planes = planes_for_display(loss_.package(), options_.displayed_px, levels);
    std::vector<std::uint32_t> shown;
    for (const PlaneChoice& p : planes) shown.push_back(p.plane);
    if (!tried_.insert(std::move(shown)).second) return std::nullopt;
    return spend_on(loss_, std::move(planes), options_, bytes_);
  }

  TextureLoss& loss_;
  const ListOptions& options_;
  std::uint64_t bytes_;
  Levels at_{};
  double without_finer_ = 0;  // FLIP that this round's steps to finer planes start from
  TextureBudget best_;
  std::set<std::vector<std::uint32_t>> tried_;
};

}  // namespace

std::uint64_t gpu_texture_bytes(std::uint32_t width_px, std::uint32_t height_px) {
  std::uint64_t texels = 0;
  for (std::uint32_t longest = std::max(width_px, height_px), level = 0; longest > 0; longest >>= 1, ++level)
    texels += std::uint64_t{std::max(1u, width_px >> level)} * std::max(1u, height_px >> level);
  return 4 * texels;
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

TextureBudget texture_for_budget(TextureLoss& loss, const ListOptions& options, std::uint64_t bytes,
                                 double memory_bytes) {
  PackageReader& package = loss.package();
  TextureBudget best = LevelSearch(loss, options, bytes).find();
  ListOptions weighted = options;
  for (int i = 0; i < kReweightings && package.quality().exponent > 1; ++i) {
    weighted.group_weights = slopes(package.quality(), best);
    TextureBudget now = spend_on(loss, best.planes, weighted, bytes);
    if (now.flip >= best.flip) break;
    best = std::move(now);
  }
  std::vector<PlaneChoice> within = planes_within(loss, best.planes, memory_bytes);
  const bool all_fit = std::ranges::equal(within, best.planes, {}, &PlaneChoice::plane, &PlaneChoice::plane);
  if (all_fit) return best;
  weighted.group_weights = best.list.group_weights;
  return spend_on(loss, std::move(within), weighted, bytes);
}

}  // namespace texmesh
