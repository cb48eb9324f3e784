// What bytes buy at each displayed height: every scale at its rungs, proxies, and the best choice for a
// budget.

#include "format/base/portable_math.h"
#include "tools/publish/report/report.h"

namespace texmesh {
namespace {

/// The bytes of a choice that gives every plane the same way: 0 = previews, else the rung before it.
std::uint64_t texture_bytes(PackageReader& package, const std::vector<PlaneChoice>& planes, std::size_t way) {
  std::uint64_t bytes = 0;
  if (way == 0) return bytes;
  for (const PlaneChoice& choice : planes) {
    const PlaneTables& t = package.tables().planes[choice.plane];
    const std::size_t rung = std::min(way, t.rung_count()) - 1;
    for (std::size_t r = t.incremental ? 0 : rung; r <= rung; ++r)
      for (std::size_t f = 0; f < t.fragment_count(); ++f) bytes += t.size_bytes[r * t.fragment_count() + f];
  }
  return bytes;
}

PerGroup texture_losses(TextureLoss& loss, const std::vector<PlaneChoice>& planes, std::size_t way) {
  PerGroup losses{};
  const PerGroup weights = loss.weights(planes);
  for (const PlaneChoice& choice : planes) {
    const auto group = static_cast<std::size_t>(loss.group_of(choice.plane));
    const TextureLoss::Plane& plane = loss.plane(choice.plane);
    const std::size_t fragments = plane.weights.size();
    if (fragments == 0 || !(weights[group] > 0)) continue;
    const std::size_t at = std::min(way, plane.shown.size() / fragments - 1);
    for (std::size_t f = 0; f < fragments; ++f)
      losses[group] +=
          static_cast<double>(plane.weights[f]) * plane.shown[at * fragments + f] / weights[group];
  }
  return losses;
}

std::size_t most_rungs(PackageReader& package) {
  std::size_t most = 0;
  for (const PlaneTables& t : package.tables().planes) most = std::max(most, t.rung_count());
  return most;
}

/// Of each scale, what is read besides textures.
std::vector<std::uint64_t> fixed_bytes(PackageReader& package) {
  std::vector<std::uint64_t> out;
  for (const ManifestScale& s : package.manifest().scales) {
    DeliveryRequest request;
    request.scale = s.scale;
    const DeliveryPlan plan = plan_budget(package, request, 0);
    out.push_back(plan.bytes() - plan.texture_bytes);
  }
  return out;
}

std::vector<QualityPoint> proxy_points(const Manifest& m, double displayed_px) {
  std::vector<QualityPoint> out;
  const std::uint64_t first = std::min(kStartBytes, m.provenance.offset + m.provenance.bytes);
  for (std::uint32_t k = 0; k < m.proxies.size(); ++k)
    out.push_back({m.scales.back().scale, k, first + proxy_bytes_beyond_start(m, k),
                   proxy_loss(m, k, displayed_px).flip});
  return out;
}

}  // namespace

std::vector<QualityCurves> quality_curves(PackageReader& package, int budgets) {
  const Manifest& m = package.manifest();
  const std::vector<std::uint64_t> fixed = fixed_bytes(package);
  std::vector<QualityCurves> out;
  for (const std::uint32_t displayed_px : package.quality().sizes_px) {
    QualityCurves& curves = out.emplace_back();
    curves.displayed_px = displayed_px;
    TextureLoss loss(package, displayed_px);
    const std::vector<PlaneChoice> planes = planes_for_display(package, displayed_px);
    std::uint64_t least = ~0ull, most = 0;
    for (std::size_t k = 0; k < m.scales.size(); ++k) {
      std::vector<QualityPoint>& points = curves.scales.emplace_back();
      for (std::size_t way = 0; way <= most_rungs(package); ++way) {
        const PerGroup losses = texture_losses(loss, planes, way);
        points.push_back({m.scales[k].scale,
                          {},
                          fixed[k] + texture_bytes(package, planes, way),
                          picture_flip(package.quality(), displayed_px, m.scales[k].scale, losses)});
        least = std::min(least, points.back().bytes);
        most = std::max(most, points.back().bytes);
      }
    }
    curves.proxies = proxy_points(m, displayed_px);
    if (!curves.proxies.empty()) least = std::min(least, curves.proxies.front().bytes);
    DeliveryRequest request;
    request.displayed_px = displayed_px;
    for (int i = 0; i < budgets; ++i) {
      const double ratio = static_cast<double>(most) / static_cast<double>(std::max<std::uint64_t>(least, 1));
      const double bytes =
          static_cast<double>(least) * portable::pow(ratio, static_cast<double>(i) / (budgets - 1));
      const DeliveryPlan plan = plan_budget(package, request, static_cast<std::uint64_t>(std::ceil(bytes)));
      if (curves.budgets.empty() || plan.bytes() > curves.budgets.back().bytes)
        curves.budgets.push_back({plan.scale, plan.proxy, plan.bytes(), plan.flip});
    }
  }
  return out;
}

}  // namespace texmesh
