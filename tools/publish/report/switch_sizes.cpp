#include "tools/publish/report/switch_sizes.h"

#include <fmt/format.h>

#include "stages/render/shade.h"

namespace texmesh {
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

ViewDifferences compare_scale(PackagePictures& pictures, int scale, int views, double displayed_px) {
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
  if (sizes.empty()) return "No coarser scale stands in for S_0 at any size, so nothing needs to hold.";
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
      "Every switch size holds: in {} views no scale differs from S_0 by more than a mean FLIP of {:.3f} "
      "(limit {:g}) and a 95th percentile of {:.3f} (limit {:g}).",
      views, worst_flip(sizes), limits.mean, p95, limits.p95);
}

double worst_flip(const std::vector<SwitchSize>& sizes) {
  double worst = 0;
  for (const SwitchSize& s : sizes) worst = std::max(worst, s.views.worst_mean());
  return worst;
}

}  // namespace texmesh
