#include "delivery/cpp/fragment_list.h"

#include <algorithm>
#include <cmath>

namespace texmesh {
namespace {

/// Rungs of a plane whose quality is within the limits, as near as there are any.
std::uint16_t limit_rung(const PlaneTables& t, double quality, bool low) {
  std::size_t rung = low ? t.rung_count() - 1 : 0;
  if (low)
    while (rung > 0 && t.rung_quality[rung - 1] >= quality) --rung;
  else
    while (rung + 1 < t.rung_count() && t.rung_quality[rung + 1] <= quality) ++rung;
  return static_cast<std::uint16_t>(rung);
}

/// Covered texels of a plane and the share of the surface that it has.
struct Cover {
  double texels = 0, surface = 0;
};
Cover cover_of(const PlaneTables& t) {
  Cover c;
  for (std::size_t f = 0; f < t.fragment_count(); ++f) {
    c.texels += t.covered_texels[f];
    c.surface += t.surface_fraction[f];
  }
  return c;
}

/// Surface of the bounding box, what a closed object of that size shows at most, in object units squared.
double surface_estimate(const Manifest& m) {
  const double x = m.bounds_max.x - m.bounds_min.x, y = m.bounds_max.y - m.bounds_min.y,
               z = m.bounds_max.z - m.bounds_min.z;
  return 2 * (x * y + y * z + z * x);
}

void add_plane(PackageReader& package, std::uint32_t plane, const ListOptions& options, FragmentList& list) {
  const PlaneTables& t = package.tables().planes[plane];
  const double role = role_weight(package.textures()[plane].role);
  const std::uint32_t scale = std::min(static_cast<std::uint32_t>(std::max(options.scale, 0)), t.scales);
  const std::vector<float> eta = eta_of(t, scale), weights = surface_weights(t);
  const std::vector<float> quality =
      quality_of(t, scale, options.gamma < 0 ? mean_eta(t, scale) : options.gamma);
  const std::uint16_t low = limit_rung(t, options.quality_low, true),
                      high = limit_rung(t, options.quality_high, false);
  for (const std::uint16_t f : t.order) {
    FragmentOffer o;
    const double weight = role * weights[f];
    o.loss.push_back(weight * (t.skip_dssim.empty() ? 1.0 : t.skip_dssim[f]));
    bool stored = true;
    for (std::size_t r = 0; r < t.rung_count(); ++r) {
      const std::uint64_t bytes = bytes_to_show(t, r, f);
      stored = stored && bytes > 0 && bytes <= 0xffffffffu;
      o.bytes.push_back(static_cast<std::uint32_t>(bytes));
      o.loss.push_back(weight * t.dssim[r * t.fragment_count() + f]);
    }
    if (!stored) continue;
    o.eta = eta[f] * weight;
    o.planned_bytes = std::max(1.0, interpolated_bytes(t, f, quality[f]));
    o.low_rung = std::min(low, high);
    o.high_rung = high;
    list.total_weight += weight;
    list.fragments.push_back({plane, f});
    list.offers.push_back(std::move(o));
  }
}

}  // namespace

double role_weight(const std::string& role) {
  if (role == "base-colour") return 1;
  if (role == "emissive") return 0.7;
  if (role == "normal" || role == "alpha") return 0.5;
  return 0.3;
}

FragmentList fragment_list(PackageReader& package, const std::vector<PlaneChoice>& planes,
                           const ListOptions& options) {
  FragmentList list;
  for (const PlaneChoice& p : planes) {
    if (p.plane >= package.tables().planes.size())
      throw InputError(package.store().name(), "texture plane " + std::to_string(p.plane),
                       "one of " + std::to_string(package.tables().planes.size()), "another");
    add_plane(package, p.plane, options, list);
  }
  return list;
}

std::vector<PlaneChoice> full_size(PackageReader& package) {
  std::vector<PlaneChoice> planes;
  for (std::uint32_t p = 0; p < full_size_planes(package.textures()); ++p) planes.push_back({p, p});
  return planes;
}

std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px) {
  const Manifest& m = package.manifest();
  const std::vector<TextureInfo>& textures = package.textures();
  std::vector<PlaneChoice> planes = full_size(package);
  const double px_per_unit = displayed_px / m.object_height, surface = surface_estimate(m);
  for (PlaneChoice& choice : planes) {
    const Cover cover = cover_of(package.tables().planes[choice.base]);
    if (!(cover.surface > 0) || !(surface > 0)) continue;
    const double texels_per_unit = std::sqrt(cover.texels / (cover.surface * surface));
    // A plane may lack its larger mips (small textures have none): the smallest that is enough counts.
    std::uint32_t best_mip = 0;
    for (std::uint32_t p = static_cast<std::uint32_t>(planes.size()); p < textures.size(); ++p) {
      const TextureInfo& t = textures[p];
      if (t.base != choice.base || t.mip <= best_mip) continue;
      if (texels_per_unit / static_cast<double>(1u << std::min(t.mip, 30u)) < px_per_unit) continue;
      best_mip = t.mip;
      choice.plane = p;
    }
  }
  return planes;
}

}  // namespace texmesh
