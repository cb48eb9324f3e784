#include "stages/render/scale_pictures.h"

#include "stages/geometry/scale_frames.h"

namespace texmesh {
namespace {

constexpr int kViews = 4;
// At the largest height, which has 16 of 21 parts of all pixels: two.
constexpr int kLargeStep = 2;

// Draco's meshes of the scans that docs/figures.md lists, within 20 %.
constexpr double kBytesPerWedge = 4, kBytesPerTriangle = 0.6;
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

/// Others in views that follow each other, and in those that are opposite.
std::vector<std::uint8_t> part_of_bands(std::uint32_t side_px, std::uint32_t view, std::uint32_t one_of) {
  std::vector<std::uint8_t> out((side_px + kBandPx - 1) / kBandPx);
  const std::uint32_t first = (one_of == 2 ? view + view / 2 : view) % one_of;
  for (std::size_t b = first; b < out.size(); b += one_of) out[b] = 1;
  return out;
}

/// Leaves rows out of comparisons that filters see mixed with what stands for bands that are not there:
/// losses were 4 % too low with them, as pictures do not differ there.
void uncover_ends_of_bands(const std::vector<std::uint8_t>& bands, Picture& picture) {
  constexpr std::uint32_t kMixed = 4;
  const auto is_there = [&](std::uint32_t y) { return y >= picture.side_px || bands[y / kBandPx]; };
  for (std::uint32_t y = 0; y < picture.side_px && !bands.empty(); ++y)
    if (!is_there(y + kMixed) || !is_there(std::max(y, kMixed) - kMixed))
      std::fill_n(picture.covered.begin() + std::ptrdiff_t{y} * picture.side_px, picture.side_px,
                  std::uint8_t{0});
}

/// How many of their finest levels textures are shown without, so that the others cost no more.
std::size_t affordable(const std::vector<RenderTexture>& textures, double bytes, double bits_per_texel) {
  for (std::size_t dropped = 0;; ++dropped) {
    double texels = 0;
    bool coarser = false;
    for (const RenderTexture& t : textures) {
      const Pixels& level = t.levels[kept_from(t, dropped)];
      texels += static_cast<double>(level.width_px) * level.height_px;
      coarser = coarser || dropped + 1 < t.levels.size();
    }
    if (texels * bits_per_texel / 8 <= bytes || !coarser) return dropped;
  }
}

}  // namespace

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

std::uint32_t enough_side_px(const std::vector<Material>& materials) {
  if (!reads_mip_levels(materials)) return std::numeric_limits<std::uint32_t>::max();
  std::size_t used = 0;
  for (const Material& m : materials) for_each_texture(m, [&](const TextureRef& t) { used += t.used(); });
  return used > 64 ? 256 : used > 24 ? 512 : used > 8 ? 1024 : 2048;
}

ReferenceViews reference_views(const Mesh& mesh, const ShownMaterials& shown, double displayed_px,
                               const RunContext& context, std::uint32_t one_of) {
  ReferenceViews out{studio_environment(), {}};
  const double extent = to_double(bounding_box(mesh.positions)).longest_side();
  const BoundingSphere sphere = bounding_sphere(mesh.positions);
  const RenderScene scene = render_scene(mesh, shown.materials, shown.textures.size());
  const int step = displayed_px > kLargePx ? kViews : displayed_px == kLargePx ? kLargeStep : 1;
  for (int v = 0; v < kViews; v += step) {
    context.check_cancelled();
    ReferenceViews::View view;
    view.camera = perspective_camera(camera_of(v, kViews, sphere.centre, sphere.radius));
    const double distance = length(view.camera.eye - sphere.centre);
    const double side = displayed_px * 2 * distance * view.camera.tan_half_fov / extent;
    view.side_px = static_cast<std::uint32_t>(std::clamp(std::ceil(side), 1.0, 8192.0));
    view.camera.tan_half_fov *= view.side_px / std::clamp(side, 0.5, 8192.0);
    if (one_of > 1) view.bands = part_of_bands(view.side_px, static_cast<std::uint32_t>(v), one_of);
    Picture picture = shade(scene, view.seen(scene, context), shown.textures, out.environment, context);
    uncover_ends_of_bands(view.bands, picture);
    view.picture = prepare_flip(picture);  // what was seen is gone by now
    out.views.push_back(std::move(view));
  }
  return out;
}

FlipSum ReferenceViews::View::loss_of(const PictureVariants& pictures, std::size_t variant,
                                      const PixelSpans& spans, Picture& shown) const {
  pictures.put(variant, shown);
  uncover_ends_of_bands(bands, shown);
  return compare_flip(picture, shown, spans);
}

FlipSum picture_loss(const ReferenceViews& reference, const RenderScene& scene,
                     const std::vector<RenderTexture>& textures, const RunContext& context, double hopeless) {
  FlipSum sum;
  const std::vector<ReferenceViews::View>& all = reference.views;
  for (std::size_t v = 0; v < all.size(); ++v) {
    if (2 * v >= all.size() && sum.mean() > hopeless) break;
    const PictureVariants pictures = shade_variants(scene, all[v].seen(scene, context), {&scene.materials, 1},
                                                    textures, reference.environment, context);
    Picture picture;
    sum.add(all[v].loss_of(pictures, 0, pictures.spans(), picture));
  }
  return sum;
}

std::vector<double> estimated_mesh_bytes(const NestedScales& scales) {
  std::vector<std::uint8_t> used;
  std::vector<double> out;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) out.push_back(mesh_bytes(scales, k, used));
  return out;
}

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

CompetingScales::CompetingScales(const NestedScales& scales, const ShownMaterials& shown,
                                 const ReferenceViews& views)
    : scales_(scales), shown_(shown), views_(views), mesh_bytes_(estimated_mesh_bytes(scales)) {}

RivalPrices CompetingScales::prices_in_plans() const {
  // Of plans of 200 to 500 kB of four scans. At 512 px they lose more by coding than pictures of half the
  // size show.
  constexpr double kMesh = 1.2, kMeshWithNormals = 1.5, kBitsPerTexel = 5, kLoss = 1.4;
  constexpr double kTableBytes = 15000, kTableBytesOfTexture = 6000;
  RivalPrices out;
  out.mesh = scales_.mesh.normals.empty() ? kMesh : kMeshWithNormals;
  out.bits_per_texel = kBitsPerTexel;
  out.loss = kLoss;
  out.besides = kTableBytes + kTableBytesOfTexture * static_cast<double>(shown_.textures.size()) +
                out.mesh * mesh_bytes_.back();
  return out;
}

/// The likeliest winners first.
std::vector<CompetingScales::Competitor> CompetingScales::competitors(std::uint64_t bytes,
                                                                      const RivalPrices& prices) const {
  const double all = std::max(0.0, static_cast<double>(bytes) - prices.besides - kFrameBytes -
                                       kPictureBytes * static_cast<double>(shown_.textures.size()));
  std::vector<Competitor> out;
  for (const double share : kMeshShares) {
    const auto found =
        std::ranges::find_if(mesh_bytes_, [&](double mesh) { return prices.mesh * mesh <= share * all; });
    const auto index = static_cast<std::size_t>(found - mesh_bytes_.begin());
    if (found != mesh_bytes_.end() && std::ranges::find(out, index, &Competitor::scale) == out.end())
      out.push_back({index, affordable(shown_.textures, all - prices.mesh * mesh_bytes_[index],
                                       prices.bits_per_texel)});
  }
  return out;
}

/// Of half of the views where that is far more than `flip`.
double CompetingScales::flip_of(const Competitor& competitor, double flip, const RunContext& context) {
  if (const auto found = known_.find(competitor); found != known_.end()) return found->second;
  const Mesh mesh = lit_scale(scales_, competitor.scale, context);
  const std::vector<RenderTexture> textures = without_finest(shown_.textures, competitor.dropped_levels);
  const RenderScene scene = render_scene(mesh, shown_.materials, textures.size());
  const double out = picture_loss(views_, scene, textures, context, kFarOff * flip).mean();
  if (out <= kFarOff * flip) known_[competitor] = out;
  return out;
}

bool CompetingScales::win(std::uint64_t bytes, double flip, const RivalPrices& prices,
                          const RunContext& context) {
  for (const Competitor& competitor : competitors(bytes, prices)) {
    const double its_flip = prices.loss * flip_of(competitor, flip, context);
    if (its_flip <= flip) return true;
    if (its_flip > kFarOff * flip) return false;
  }
  return false;
}

bool CompetingScales::likeliest_wins(std::uint64_t bytes, double flip, const RivalPrices& prices,
                                     const RunContext& context) {
  const std::vector<Competitor> all = competitors(bytes, prices);
  return !all.empty() && prices.loss * flip_of(all.front(), flip, context) <= flip;
}

}  // namespace texmesh
