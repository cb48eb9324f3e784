// Models of few texels and triangles: what is not rendered of them follows by a table that was fitted once.
//
// Fitted over twelve models (made rocks and owls of 600 to 4,000 triangles with textures of 256 to 640 px;
// Eros, a bottle, a bust and a banana cut to 1,000 to 2,200), checked on nineteen others (made ones, a face,
// a head, a yurt) beside pictures in four views at all heights. tests/bench/few_table prints how far models
// are off.
#include "format/base/portable_math.h"
#include "format/documents/manifest.h"
#include "stages/quality/table_fit.h"

namespace texmesh {
namespace {

// What all views lose at the table's height, where texels are as large as pixels, beside one view at 0.71 of
// it: mean error of the models of the fit, of the others.
constexpr double kScales = 1.12;    // 6 and 5 %
constexpr double kPreviews = 1.12;  // 4 and 4 %
// Coarser mips, as exp(at - slope * texel level): the next one, 9 and 7 %, and the one behind it, 5 and 5 %.
struct MipGrowth {
  double at, slope;
};
constexpr std::array<MipGrowth, kCoarserLevels> kMips{{{0.5, 0.21}, {0.29, 0.11}}};
// By how much scales and previews have grown to there from half the height.
constexpr double kScalesGrew = 1.24, kPreviewsGrew = 1.15;
// Of scales, at half the height and less; what the worst of all views loses beside the one.
constexpr double kScalesShrink = 1.3, kWorstView = 1.25;

PictureLosses times(PictureLosses losses, double factor) {
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95})
    for (float& v : losses.*list) v = static_cast<float>(std::min(1.0, static_cast<double>(v) * factor));
  return losses;
}

/// `level` of texels at the table's height.
PictureLosses coarser_mips(PictureLosses losses, double level) {
  for (const auto list : {&PictureLosses::flip, &PictureLosses::flip_p95})
    for (std::size_t l = 0; l < losses.size(); ++l) {
      const double growth = portable::exp(std::max(0.0, kMips[l].at - kMips[l].slope * level));
      float& v = (losses.*list)[l];
      v = static_cast<float>(std::min(1.0, static_cast<double>(v) * growth));
    }
  return losses;
}

TextureLosses losses_of_all(const GroupCells& cells) {
  return texture_losses(
      cells,
      {losses_of(cells.coded, nullptr), times(losses_of(cells.preview, nullptr), kPreviews),
       losses_of(cells.finer, nullptr), coarser_mips(losses_of(cells.coarser, nullptr), cells.texel_level)},
      kFewExponent);
}

/// How many times as much all views may lose until one is beyond.
double room_of(const Losses& losses, const ShotLimits& limits) {
  constexpr double kPart = 0.95, kNothing = 1e-6;
  const Loss all = pooled(losses);
  return std::min(limits.mean / std::max(kNothing, all.flip.mean()),
                  limits.p95 / std::max(kNothing, all.flip.percentile(kPart))) /
         kWorstView;
}

}  // namespace

OneRow render_row(const TextureSampler& sampler, double table_px, Studio& studio, const RunContext& context) {
  OneRow out;
  const auto render = [&](double px, const SizeTask& task, SizeCells& cells, double done) {
    context.check_cancelled();
    cells.displayed_px = px;
    RunContext quiet = context;
    quiet.progress = nullptr;
    render_size(sampler, task, studio, cells, quiet);
    context.report(done);
  };
  render(table_px / 4, {{}, std::nullopt, 0}, out.small, 0.2);
  const std::vector<std::optional<ViewPart>> all(studio.scenes.size(), ViewPart::kLargest);
  render(table_px * std::sqrt(0.5), {all, std::nullopt, 0}, out.row, 1);
  for (GroupCells& group : out.row.groups) group.texel_level += 0.5;
  return out;
}

void fill_from_row(const OneRow& rendered, double table_px, const std::vector<PlanesOfGroup>& groups,
                   QualityTable& table) {
  const PictureLosses geometry = times(losses_of(rendered.row.geometry, nullptr), kScales);
  table.geometry = {geometry, times(geometry, 1 / kScalesGrew), geometry};
  for (const double px : {table_px / 4, table_px / 2, table_px})
    table.sizes_px.push_back(static_cast<std::uint32_t>(std::lround(px)));
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const GroupCells &small = rendered.small.groups[g], &row = rendered.row.groups[g];
    const TextureLosses losses = losses_of_all(row);
    std::vector<TextureLosses> sizes{losses_of_all(small), losses, losses};
    lend_knots({small.texel_level, row.texel_level, row.texel_level}, sizes);
    sizes[1].preview = times(std::move(sizes[1].preview), 1 / kPreviewsGrew);
    table.groups.push_back({groups[g].group, std::move(sizes)});
  }
  table.exponent = kFewExponent;
  table.error = kFewError;
}

std::vector<float> one_row_switch_px(const OneRow& rendered, const ShotLimits& limits,
                                     const QualityOptions& options) {
  std::vector<float> out(rendered.row.geometry.size(), 0);
  out[0] = static_cast<float>(kAnyDisplayPx);
  const double octaves = portable::log(options.largest_px / rendered.row.displayed_px) / portable::log(2.0);
  for (std::size_t k = 1; k < out.size(); ++k) {
    const double room = room_of(rendered.row.geometry[k], limits);
    for (int halves = 0;; ++halves) {
      const double px = std::ldexp(options.largest_px, -(halves / 2)) * (halves % 2 ? std::sqrt(0.5) : 1);
      const double above = octaves - 0.5 * halves;
      if (px < kLeastSwitchPx) break;
      if (portable::pow(above > 0 ? kScalesGrew : kScalesShrink, above) > room) continue;
      out[k] = static_cast<float>(px);
      break;
    }
  }
  return out;
}

}  // namespace texmesh
