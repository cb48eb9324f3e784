#include "tools/publish/report/report_pictures.h"

#include <fmt/format.h>

#include "format/rules/allocation.h"
#include "pipeline/io/markup.h"
#include "stages/image/pixel_window.h"
#include "stages/image/png_writer.h"
#include "stages/render/shade.h"

namespace texmesh {
namespace {

// Every eighth of the map "magma" (van der Walt and Smith, 2015), the one that FLIP's authors use.
constexpr std::array<Srgb, 9> kStops{{{0, 0, 4},
                                      {28, 16, 68},
                                      {79, 18, 123},
                                      {129, 37, 129},
                                      {181, 54, 122},
                                      {229, 80, 100},
                                      {251, 135, 97},
                                      {254, 194, 135},
                                      {252, 253, 191}}};

constexpr std::uint32_t kMargin = 6;  // px around the object
constexpr int kMostEnlarged = 6;

/// What either picture shows with its margin; all where they show nothing.
TexelRectangle shown_part(const Picture& a, const Picture& b) {
  const std::uint32_t side = a.side_px;
  std::uint32_t left = side, top = side, right = 0, bottom = 0;  // right and bottom are outside
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const std::size_t i = std::size_t{y} * side + x;
      if (!a.covered[i] && !b.covered[i]) continue;
      left = std::min(left, x), top = std::min(top, y);
      right = std::max(right, x + 1), bottom = std::max(bottom, y + 1);
    }
  if (left >= right) return {0, 0, side, side};
  left -= std::min(left, kMargin), top -= std::min(top, kMargin);
  return {left, top, std::min(right + kMargin, side) - left, std::min(bottom + kMargin, side) - top};
}

constexpr double kLongerSide = 360;  // px on the page

/// Parts of what 95 % of the fragments do not exceed: one fragment of few texels would leave the others
/// black.
FragmentHeat over_most(std::string name, std::vector<double> value) {
  std::vector<double> known;
  std::ranges::copy_if(value, std::back_inserter(known), [](double v) { return v > 0; });
  if (known.empty()) return {std::move(name), std::move(value)};
  const auto at = known.begin() + static_cast<std::ptrdiff_t>(known.size() * 95 / 100);
  std::ranges::nth_element(known, at);
  for (double& v : value)
    if (v > 0) v = std::min(1.0, v / *at);
  return {std::move(name), std::move(value)};
}

}  // namespace

Srgb heat_colour(double value) { return colour_on(kStops, value); }

/// A square picture of FLIP values, `side_px` a side, in heat colours: 0 is black, `full` and more is the
/// last colour.
static Pixels heat_picture(const std::vector<float>& values, std::uint32_t side_px, double full) {
  Pixels out{side_px, side_px, 3, {}};
  out.data.reserve(values.size() * 3);
  for (const float v : values) {
    const Srgb c = heat_colour(static_cast<double>(v) / full);
    out.data.insert(out.data.end(), c.begin(), c.end());
  }
  return out;
}

std::string heat_hex(double value) { return hex_of(heat_colour(value)); }

std::string picture_row(const PictureRow& row, const Picture& reference, const Picture& tested,
                        std::vector<ReportFile>& files) {
  const TexelRectangle part = shown_part(reference, tested);
  const FlipPicture a = prepare_flip(reference), b = prepare_flip(tested);
  const Pixels heat = heat_picture(flip_map(a, b), reference.side_px, kFullHeat);
  const int times =
      std::clamp(static_cast<int>(row.enlarge_to_px / static_cast<double>(part.width_px)), 1, kMostEnlarged);
  std::string out = "<div class=\"row\">\n";
  const auto add = [&](const std::string& ending, const std::string& name, const std::string& alt,
                       const Pixels& pixels) {
    files.push_back({row.name + ending + ".png", write_png(cut(pixels, part))});
    out += fmt::format(
        "<div><p class=\"quiet\">{}</p><img{} src=\"{}\" width=\"{}\" height=\"{}\" alt=\"{}\"></div>\n",
        name, times > 1 ? " class=\"enlarged\"" : "", markup_escaped(files.back().path),
        part.width_px * static_cast<std::uint32_t>(times), part.height_px * static_cast<std::uint32_t>(times),
        markup_escaped(alt));
  };
  add("-reference", row.reference_name, row.alt + ", the reference", encode_srgb(reference));
  add("-tested", row.tested_name, row.alt, encode_srgb(tested));
  add("-flip", "where they differ", row.alt + ": map of the differences", heat);
  return out + "</div>\n";
}

std::vector<FragmentHeat> fragment_heats(PackageReader& package, std::uint32_t plane) {
  const PlaneTables& t = package.tables().planes.at(plane);
  const std::size_t fragments = t.fragment_count();
  std::vector<double> bytes(fragments, -1), density(fragments, -1);
  const std::vector<float> eta = density_of(t, 0);
  for (const std::uint16_t f : t.order) {
    const double texels = std::max<double>(t.covered_texels[f], 1);
    if (t.rung_count() > 0) bytes[f] = static_cast<double>(bytes_to_show(t, t.rung_count() - 1, f)) / texels;
    density[f] = static_cast<double>(eta[f]);
  }
  return {over_most("bytes for each texel, at the best quality", std::move(bytes)),
          over_most("how many features the shape has (eta)", std::move(density))};
}

std::string fragment_map(PackageReader& package, std::uint32_t plane, const FragmentHeat& heat,
                         const std::string& preview) {
  const TextureInfo& t = package.textures().at(plane);
  const double shrink = kLongerSide / std::max(t.width_px, t.height_px);
  const double width = t.width_px * shrink, height = t.height_px * shrink;
  std::string out = fmt::format(
      "<svg class=\"map{}\" role=\"img\" aria-label=\"{}\" width=\"{:.0f}\" height=\"{:.0f}\" "
      "viewBox=\"0 0 {:.1f} {:.1f}\"><image href=\"{}\" width=\"{:.1f}\" height=\"{:.1f}\" "
      "preserveAspectRatio=\"none\"/>\n",
      heat.value.empty() ? "" : " heat",
      markup_escaped("Map of texture " + std::to_string(plane) + ": " + heat.name), width, height, width,
      height, markup_escaped(preview), width, height);
  const double w = t.fragment_width_px * shrink, h = t.fragment_height_px * shrink;
  for (std::size_t f = 0; f < std::size_t{t.columns} * t.rows; ++f) {
    const std::size_t column = f % t.columns, row = f / t.columns;
    const double x = static_cast<double>(column) * w, y = static_cast<double>(row) * h;
    if (heat.value.empty() || heat.value[f] < 0)
      out += fmt::format(
          "<path d=\"M{:.1f} {:.1f}h{:.1f}v{:.1f}h-{:.1f}z\" fill=\"none\" stroke=\"#888\" "
          "stroke-width=\".4\"/>\n",
          x, y, std::min(w, width - x), std::min(h, height - y), std::min(w, width - x));
    else
      out += fmt::format(
          "<rect x=\"{:.1f}\" y=\"{:.1f}\" width=\"{:.1f}\" height=\"{:.1f}\" fill=\"{}\" "
          "fill-opacity=\".62\" stroke=\"#888\" stroke-width=\".4\"><title>row {}, column {}: "
          "{:.2f} of the largest</title></rect>\n",
          x, y, std::min(w, width - x), std::min(h, height - y), heat_hex(heat.value[f]), row, column,
          heat.value[f]);
  }
  return out + "</svg>\n";
}

namespace {

constexpr double kMostSide = 8192;
constexpr double kPercentile = 0.95;

PackageChoice finest_choice(PackageChoice choice) {
  choice.scale = 0;
  return choice;
}

/// As the quality stage renders: with mips, whatever the sampler says.
void read_with_mips(RenderedModel& model) {
  for (RenderMaterial& m : model.materials)
    for (TextureSlot& slot : m.textures) slot.min_filter = MinFilter::kTrilinear;
}

/// Side of a picture per px of displayed height.
double side_per_px(const RenderedModel& model, double object_height) {
  const RenderCamera c = perspective_camera(camera_of(0, 1, model.bounds.centre, model.bounds.radius));
  if (!(object_height > 0)) return 1;
  return 2 * c.tan_half_fov * length(c.eye - model.bounds.centre) / object_height;
}

float largest(const std::vector<float>& values) {
  return values.empty() ? 0 : *std::max_element(values.begin(), values.end());
}

}  // namespace

PackagePictures::PackagePictures(PackageReader& package, const PackageChoice& textures,
                                 const RunContext& context)
    : package_(package),
      context_(context),
      finest_(package_model(package, finest_choice(textures), context)),
      environment_(studio_environment()) {
  context_.progress = nullptr;
  read_with_mips(finest_);
}

std::uint32_t PackagePictures::side_for(double displayed_px) const {
  const double side = displayed_px * side_per_px(finest_, package_.manifest().object_height);
  return static_cast<std::uint32_t>(std::clamp(std::round(side), 1.0, kMostSide));
}

double PackagePictures::largest_px() const {
  return kMostSide / side_per_px(finest_, package_.manifest().object_height);
}

RenderCamera PackagePictures::camera(Vec3d offset, ViewNumber view) const {
  return perspective_camera(
      camera_of(view.index, view.count, finest_.bounds.centre + offset, finest_.bounds.radius));
}

Picture PackagePictures::picture_of(const RenderedModel& model, Vec3d offset, ViewNumber view,
                                    std::uint32_t side_px) const {
  const RenderScene scene = render_scene(model.mesh, model.materials, model.texture_images.size());
  const std::vector<RenderTexture>& textures = model.textures.empty() ? finest_.textures : model.textures;
  return shade(scene, look(scene, camera(offset, view), side_px, context_), textures, environment_, context_);
}

Picture PackagePictures::picture(int scale, ViewNumber view, std::uint32_t side_px) {
  if (scale != 0 && scale != coarser_number_) {
    coarser_ = package_scale(package_, scale, finest_, context_);
    read_with_mips(coarser_);
    coarser_number_ = scale;
  }
  return picture_of(scale == 0 ? finest_ : coarser_, {}, view, side_px);
}

std::size_t ViewDifferences::worst() const {
  return static_cast<std::size_t>(std::max_element(mean.begin(), mean.end()) - mean.begin());
}
double ViewDifferences::worst_mean() const { return static_cast<double>(largest(mean)); }
double ViewDifferences::worst_p95() const { return static_cast<double>(largest(p95)); }

/// A scale beside S_0.
static ViewDifferences compare_scale(PackagePictures& pictures, int scale, int views, double displayed_px) {
  ViewDifferences out;
  const std::uint32_t side_px = pictures.side_for(displayed_px);
  for (int v = 0; v < views; ++v) {
    const FlipSum flip = compare_flip(prepare_flip(pictures.picture(0, {v, views}, side_px)),
                                      prepare_flip(pictures.picture(scale, {v, views}, side_px)));
    out.mean.push_back(static_cast<float>(flip.mean()));
    out.p95.push_back(static_cast<float>(flip.percentile(kPercentile)));
  }
  return out;
}

std::vector<SwitchSize> measure_switch_sizes(PackageReader& package, PackagePictures& pictures, int views,
                                             const RunContext& context) {
  std::vector<SwitchSize> out;
  const Manifest& m = package.manifest();
  for (const ManifestStep& step : m.steps) {
    if (step.scale == 0) continue;
    context.check_cancelled();
    SwitchSize size;
    size.scale = step.scale;
    size.triangles = m.scales[package.scale_index(step.scale)].triangles;
    size.up_to_px = step.up_to_px;
    size.rendered_px = std::min(step.up_to_px, pictures.largest_px());
    size.views = compare_scale(pictures, step.scale, views, size.rendered_px);
    out.push_back(std::move(size));
  }
  return out;
}

std::string switch_verdict(const std::vector<SwitchSize>& sizes, const FlipLimits& limits, int views) {
  if (sizes.empty())
    return "The object looks like the original at every size, for the whole mesh (S_0) is shown at each.";
  std::string failing;
  std::size_t count = 0;
  double p95 = 0;
  for (const SwitchSize& s : sizes) {
    p95 = std::max(p95, s.views.worst_p95());
    if (s.holds(limits)) continue;
    failing += fmt::format("{}S_{} at {:.0f} px (mean FLIP {:.3f}, 95th percentile {:.3f})",
                           failing.empty() ? "" : ", ", s.scale, s.rendered_px, s.views.worst_mean(),
                           s.views.worst_p95());
    ++count;
  }
  if (count > 0)
    return fmt::format("{} of {} switch sizes {} not hold in {} views: {}. The limits are {:g} and {:g}.",
                       count, sizes.size(), count == 1 ? "does" : "do", views, failing, limits.mean,
                       limits.p95);
  return fmt::format(
      "The object looks like the original at every size. Every switch size holds: in {} views no scale differs from S_0 by more than a mean FLIP of {:.3f} "
      "(limit {:g}) and a 95th percentile of {:.3f} (limit {:g}).",
      views, worst_flip(sizes), limits.mean, p95, limits.p95);
}

double worst_flip(const std::vector<SwitchSize>& sizes) {
  double worst = 0;
  for (const SwitchSize& s : sizes) worst = std::max(worst, s.views.worst_mean());
  return worst;
}

}  // namespace texmesh
