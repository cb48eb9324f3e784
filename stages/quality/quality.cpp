#include "format/documents/manifest.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/geometry/scale_frames.h"
#include "stages/quality/table_fit.h"

namespace texmesh {
namespace {

/// A displayed height that is rendered whatever comes out, and the one between it and the next lower one.
struct Height {
  double displayed_px = 0, between_px = 0;
  std::optional<std::size_t> rank;  // among the sizes that show textures
};
/// Rising, each twice the one before, up to `largest_px` halved no time. Textures show at kTextureSizes of
/// them, the last of which is `largest_px` halved `fewer` times.
std::vector<Height> heights_below(double largest_px, std::size_t fewer) {
  std::vector<Height> heights;
  for (std::size_t halvings = 0;; ++halvings) {
    const double px = std::ldexp(largest_px, -static_cast<int>(halvings));
    const bool shows = halvings >= fewer && halvings < fewer + kTextureSizes;
    if (halvings < fewer + kTextureSizes ? px < 1 : px < kLeastSwitchPx)
      break;  // the table holds whole pixels
    heights.push_back({px, px * std::sqrt(0.5),
                       shows ? std::optional(fewer + kTextureSizes - 1 - halvings) : std::nullopt});
  }
  std::reverse(heights.begin(), heights.end());
  return heights;
}

/// Scales with meshes of their own, as their files light them: a view costs by the positions that it looks
/// at.
struct KeptScales {
  std::vector<int> numbers;
  std::vector<Mesh> coarser;  // all but S_0, which is the nest's own mesh: a copy of a large one would count
};
KeptScales kept_scales(const NestedScales& scales, const PerceptualValues& perceptual,
                       const RunContext& context) {
  KeptScales out;
  for (std::size_t k = 0; k < scales.scales.size(); ++k) {
    if (k > 0 && !perceptual.kept[k]) continue;
    out.numbers.push_back(scales.scales[k].scale);
    if (k > 0) out.coarser.push_back(lit_scale(scales, k, context));
  }
  return out;
}

std::vector<RenderScene> scenes_of(const NestedScales& scales, const KeptScales& kept,
                                   const ShownTextures& shown) {
  const NestedScale& finest = scales.scales[0];
  std::vector<RenderScene> out{
      {&scales.mesh, &finest.triangles, &finest.triangle_source, &shown.materials, shown.textures.size()}};
  for (const Mesh& mesh : kept.coarser)
    out.push_back(render_scene(mesh, shown.materials, shown.textures.size()));
  return out;
}

/// Whether nobody can tell the scale from S_0 in any view.
bool passes(const Losses& losses, const ShotLimits& limits) {
  return std::ranges::all_of(losses, [&](const Loss& loss) { return limits.hold(loss); });
}

/// Up to a quarter of the largest height all views count.
bool is_small(double displayed_px, const QualityOptions& options) {
  return displayed_px < options.largest_px / 4.0 * 1.001;
}

/// The worst of 12 views is up to 1.24 times the worse of two (saxophone and turtle, 256 and 1024 px).
ShotLimits limits_at(double displayed_px, const QualityOptions& options) {
  const int views =
      is_small(displayed_px, options) ? options.views : std::min(options.views, options.large_views);
  const double share = views >= 12 ? 1 : views >= 6 ? 0.9 : 0.8;
  return {share * options.flip_mean, share * options.flip_p95};
}

/// The switch sizes, found from small heights to large ones.
class SwitchSizes {
 public:
  SwitchSizes(std::size_t scales, const QualityOptions& options)
      : options_(options), alive_(scales, 1), display_px_(scales, 0) {
    alive_[0] = 0;
    display_px_[0] = static_cast<float>(kAnyDisplayPx);
  }
  const std::vector<std::uint8_t>& alive() const { return alive_; }
  const std::vector<float>& display_px() const { return display_px_; }

  /// Of scales that have passed all heights so far. Returns those that fail here.
  std::vector<std::uint8_t> judge(const LossCells& geometry, double displayed_px) {
    std::vector<std::uint8_t> failed(alive_.size(), 0);
    for (std::size_t k = 1; k < alive_.size(); ++k) {
      if (!alive_[k]) continue;
      alive_[k] = passes(geometry[k], limits_at(displayed_px, options_));
      if (alive_[k]) display_px_[k] = static_cast<float>(displayed_px);
      failed[k] = !alive_[k];
    }
    return failed;
  }
  /// Of scales that have passed the height below and failed the one above.
  void judge_between(const LossCells& geometry, const std::vector<std::uint8_t>& scales,
                     double displayed_px) {
    for (std::size_t k = 1; k < scales.size(); ++k)
      if (scales[k] && passes(geometry[k], limits_at(displayed_px, options_)))
        display_px_[k] = static_cast<float>(displayed_px);
  }

 private:
  const QualityOptions& options_;
  std::vector<std::uint8_t> alive_;
  std::vector<float> display_px_;
};

ViewPart views_at(double displayed_px, const QualityOptions& options) {
  return is_small(displayed_px, options) ? ViewPart::kAll : ViewPart::kLarge;
}

/// The views in which scales are rendered: those that still pass, and what the table needs of a size beside.
/// `few` texels and triangles: half the views, and the coarsest speaks for all at the largest size.
std::vector<std::optional<ViewPart>> rendered_scales(const std::vector<std::uint8_t>& alive,
                                                     const Height& height, bool few,
                                                     const QualityOptions& options) {
  const std::size_t n = alive.size();
  std::vector<std::optional<ViewPart>> out(n);
  for (std::size_t k = 1; k < n; ++k) {
    if (alive[k]) out[k] = views_at(height.displayed_px, options);
    if (alive[k] || !height.rank) continue;
    if (*height.rank == 0) out[k] = few ? ViewPart::kLarge : ViewPart::kAll;
    if (*height.rank == 1 && (n - 1 - k) % 2 == 0) out[k] = few ? ViewPart::kLargest : ViewPart::kLarge;
    if (*height.rank == 2 && !few && (k == 1 || k + 1 == n)) out[k] = ViewPart::kLargest;
  }
  return out;
}

/// Half octaves are rendered for the scales alone that fail the octave above.
void judge_size(const SizeCells& cells, const Height& height, const TextureSampler& sampler,
                const QualityOptions& options, Studio& studio, SwitchSizes& sizes,
                const RunContext& context) {
  if (height.displayed_px < kLeastSwitchPx) return;
  const std::vector<std::uint8_t> failed = sizes.judge(cells.geometry, height.displayed_px);
  if (height.between_px < kLeastSwitchPx || std::ranges::find(failed, 1) == failed.end()) return;
  SizeTask task{
      std::vector<std::optional<ViewPart>>(failed.size()), limits_at(height.between_px, options), {}};
  for (std::size_t k = 0; k < failed.size(); ++k)
    if (failed[k]) task.scales[k] = views_at(height.between_px, options);
  SizeCells between{height.between_px, {}, {}, {}};
  render_size(sampler, task, studio, between, context);
  sizes.judge_between(between.geometry, failed, height.between_px);
}

/// What a height costs beside the others, about: those of the table are rendered with many textures.
double cost_of(const Height& height) {
  constexpr double kUnranked = 0.3, kRanks[] = {3.5, 1.5, 3};
  return height.rank ? kRanks[std::min(*height.rank, std::size(kRanks) - 1)] : kUnranked;
}

std::vector<SizeCells> render_heights(const TextureSampler& sampler, const QualityOptions& options,
                                      std::size_t fewer, Studio& studio, SwitchSizes& sizes,
                                      const RunContext& context) {
  const std::vector<Height> heights = heights_below(options.largest_px, fewer);
  std::vector<SizeCells> table_cells;
  constexpr double kBefore = 0.9, kAfter = 0.2;  // looking around, fitting the table, as costs are counted
  double all = kBefore + kAfter, done = kBefore;
  for (const Height& height : heights) all += cost_of(height);
  RunContext quiet = context;
  quiet.progress = nullptr;
  for (std::size_t i = 0; i < heights.size(); ++i) {
    context.check_cancelled();
    const double cost = cost_of(heights[i]);
    RunContext told = context;
    told.progress = [&context, all, done, cost](double part) { context.report((done + cost * part) / all); };
    told.report(0);
    SizeCells cells{heights[i].displayed_px, {}, {}, {}};
    SizeTask task{rendered_scales(sizes.alive(), heights[i], fewer > 0, options), std::nullopt,
                  heights[i].rank};
    if (!task.rank) task.ends_beyond = limits_at(heights[i].displayed_px, options);
    render_size(sampler, task, studio, cells, told);
    judge_size(cells, heights[i], sampler, options, studio, sizes, quiet);
    done += cost;
    if (heights[i].rank) table_cells.push_back(std::move(cells));
  }
  return table_cells;
}

/// What finer mips of the smaller size lose, in the order of the larger one: full size, which may have the
/// source's texels, comes as many levels earlier there as its planes are finer.
PictureLosses finer_along(const PictureLosses& finer, const GroupCells& smaller, const GroupCells& larger) {
  const auto whole = [](double x) { return static_cast<std::size_t>(std::lround(std::max(0.0, x))); };
  const std::size_t full_size = whole(mean_mip(larger)), fewer = whole(mean_mip(smaller) - mean_mip(larger));
  PictureLosses out = finer;
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95, &PictureLosses::dssim})
    for (std::size_t l = full_size; l < finer.size(); ++l)
      (out.*list)[l] = (finer.*list)[std::min(l + fewer, finer.size() - 1)];
  return out;
}

// Of models of few texels and triangles, fitted over six made ones and four scans cut to 1,500 to 2,300
// triangles (docs/decisions/quality-table.md): how losses add up (2.0 to 2.5), the error of what is predicted
// for plans of ten others, and what is left at twice the height of what finer texels lose by charts' borders
// (.3 to .7).
constexpr float kFewExponent = 2.15f, kFewError = 0.1f, kSeamsLeft = 0.5f;

/// What the knots of all groups and the scales lose at one size, rendered or not.
struct RawLosses {
  PictureLosses geometry;
  std::vector<GroupPictures> groups;
};

/// `before`: what previews lost at the size below `smaller`, where theirs grow along.
GroupPictures group_pictures(const GroupCells& group, const GroupCells& smaller,
                             const GroupPictures& measured, const PictureLosses* before) {
  const auto follow = [](const LossCells& cells, const SmallerSize& below) {
    return losses_of(cells, &below);
  };
  PictureLosses along = finer_along(measured.finer, smaller, group);
  if (before)
    for (float& f : along.flip) f *= kSeamsLeft;
  PictureLosses finer = follow(group.finer, {smaller.finer, measured.finer, std::move(along)});
  PictureLosses coded = along_curve(group, smaller, measured, finer);
  PictureLosses coarser =
      follow(group.coarser, {smaller.coarser, measured.coarser, coarser_along(group, smaller, measured)});
  raise_to_smaller(group, smaller, measured, coarser);
  return {
      follow(group.coded, {smaller.coded, measured.coded, std::move(coded), true}),
      follow(group.preview, {smaller.preview, measured.preview,
                             before ? enlarged(measured.preview, *before, kPreviewGrows) : measured.preview}),
      std::move(finer), std::move(coarser)};
}

/// `few` texels and triangles: the largest size follows from those below.
std::vector<RawLosses> raw_losses(const std::vector<SizeCells>& sizes, bool few) {
  std::vector<RawLosses> out;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    RawLosses raw;
    if (i == 0) {
      raw.geometry = losses_of(sizes[i].geometry, nullptr);
      for (const GroupCells& g : sizes[i].groups)
        raw.groups.push_back({losses_of(g.coded, nullptr), losses_of(g.preview, nullptr),
                              losses_of(g.finer, nullptr), losses_of(g.coarser, nullptr)});
    } else {
      const PictureLosses& measured = out[i - 1].geometry;
      const bool follows = few && i >= 2;
      const SmallerSize below{sizes[i - 1].geometry, measured,
                              follows ? enlarged(measured, out[i - 2].geometry, kGeometryGrows) : measured};
      raw.geometry = losses_of(sizes[i].geometry, &below);
      for (std::size_t g = 0; g < sizes[i].groups.size(); ++g)
        raw.groups.push_back(group_pictures(sizes[i].groups[g], sizes[i - 1].groups[g], out[i - 1].groups[g],
                                            follows ? &out[i - 2].groups[g].preview : nullptr));
    }
    out.push_back(std::move(raw));
  }
  return out;
}

void fill_table(const std::vector<SizeCells>& sizes, const std::vector<PlanesOfGroup>& groups, bool few,
                QualityTable& table) {
  const std::vector<RawLosses> raw = raw_losses(sizes, few);
  for (const PlanesOfGroup& group : groups) table.groups.push_back({group.group, {}});
  std::vector<TogetherLoss> together;
  for (std::size_t i = 0; i < sizes.size(); ++i) {
    table.sizes_px.push_back(static_cast<std::uint32_t>(std::lround(sizes[i].displayed_px)));
    table.geometry.push_back(raw[i].geometry);
    for (const TogetherCell& cell : sizes[i].together) {
      TogetherLoss& sample = together.emplace_back();
      sample.measured = pooled(cell.losses).flip.mean();
      // In the same views, where the part was rendered in them.
      const auto add = [&](const Losses& alone, float otherwise) {
        sample.parts.push_back(alone.empty() ? static_cast<double>(otherwise)
                                             : pooled(alone, cell.losses).flip.mean());
      };
      add(sizes[i].geometry[cell.scale], raw[i].geometry.flip[cell.scale]);
      for (std::size_t g = 0; g < groups.size(); ++g) {
        const auto cells = cell.shown == Together::kCoded     ? &GroupCells::coded
                           : cell.shown == Together::kCoarser ? &GroupCells::coarser
                                                              : &GroupCells::preview;
        const auto pictures = cell.shown == Together::kCoded     ? &GroupPictures::coded
                              : cell.shown == Together::kCoarser ? &GroupPictures::coarser
                                                                 : &GroupPictures::preview;
        add((sizes[i].groups[g].*cells).back(), (raw[i].groups[g].*pictures).flip.back());
      }
    }
  }
  fit_exponent(together, table);
  if (few) table.exponent = kFewExponent, table.error = kFewError;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    std::vector<double> texel_level;
    for (std::size_t i = 0; i < sizes.size(); ++i) {
      table.groups[g].sizes.push_back(texture_losses(sizes[i].groups[g], raw[i].groups[g], table.exponent));
      texel_level.push_back(sizes[i].groups[g].texel_level);
    }
    lend_knots(texel_level, table.groups[g].sizes);
  }
}

/// Per group, of that size's textures shown twice as large as often.
std::vector<double> texel_levels(const SizeCells& size, std::size_t doublings) {
  std::vector<double> out;
  for (const GroupCells& g : size.groups) out.push_back(g.texel_level + static_cast<double>(doublings));
  return out;
}

}  // namespace

MeasuredQuality measure_quality(const NestedScales& scales, const PerceptualValues& perceptual,
                                const std::vector<Material>& materials, const std::vector<Image>& images,
                                const Fragments& fragments, const std::vector<Pixels>& pixels,
                                const Ladder& ladder, const Previews& previews, const PackageTables& tables,
                                const QualityOptions& options, const RunContext& context) {
  if (scales.mesh.positions.empty()) throw StageError("quality", "S_0", "positions", "none");
  const KeptScales kept = kept_scales(scales, perceptual, context);
  const ShownTextures shown = find_shown(materials, fragments, scales.mesh);
  const TextureData data = texture_data(images, fragments, pixels, ladder, previews, tables);
  const std::vector<PlanesOfGroup> groups = find_groups(shown, fragments);
  MeasuredQuality result;
  Studio studio;
  studio.views = choose_views(options.views, options.large_views);
  studio.scenes = scenes_of(scales, kept, shown);
  TextureSizes sizes;
  for (const ShownTexture& t : shown.textures)
    sizes.push_back({fragments.planes[t.plane].width_px, fragments.planes[t.plane].height_px});
  const Coverage seen = frame_object(studio.scenes[0], sizes, static_cast<double>(perceptual.object_height),
                                     options.views, options.largest_px, result.notes, context);
  if (seen.pixels == 0)
    add_warning(result.notes, "quality-not-measured", "",
                "no picture shows anything of the object; its scales count as equal");
  studio.frame = seen.frame;
  studio.rows = seen.rows;
  const double looked_at = looked_at_px(scales.scales[0].triangles.size());
  studio.pixels_of_unit = static_cast<double>(seen.pixels) / (options.views * looked_at * looked_at);
  studio.environment = studio_environment();
  for (std::size_t t = 0; t < shown.textures.size(); ++t)
    studio.textures.push_back(source_texture(
        data, shown.textures[t], shown.textures[t].with_mips ? seen.first_levels[t] : 0, context));

  const TextureSampler sampler{data, shown, groups, options.rung_samples,
                               surface_area(scales.mesh, scales.scales[0].triangles)};
  SwitchSizes switch_sizes(kept.numbers.size(), options);
  const std::size_t fewer =
      fewer_heights(sampler, scales.scales[0].triangles.size(), studio.frame.extent, options);
  studio.few = fewer > 0;
  const std::vector<SizeCells> cells = render_heights(sampler, options, fewer, studio, switch_sizes, context);
  result.table.views = static_cast<std::uint32_t>(options.views);
  result.table.scales = kept.numbers;
  fill_table(cells, groups, studio.few, result.table);
  for (std::size_t i = 0; i < fewer; ++i) enlarge(texel_levels(cells.back(), i), result.table);
  result.display_px_flip = switch_sizes.display_px();
  return result;
}

}  // namespace texmesh
