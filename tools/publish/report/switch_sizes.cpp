#include "tools/publish/report/switch_sizes.h"

#include <fmt/format.h>

#include <algorithm>

namespace texmesh {

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
