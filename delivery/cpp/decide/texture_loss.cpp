#include "delivery/cpp/decide/texture_loss.h"

#include "format/rules/allocation.h"
#include "format/rules/viewing.h"

namespace texmesh {
namespace {

/// Area of the object; where the package does not say it that of the bounding box. Object units squared.
double surface_of(const Manifest& m) {
  if (m.surface_area > 0) return m.surface_area;
  const double x = m.bounds_max.x - m.bounds_min.x, y = m.bounds_max.y - m.bounds_min.y,
               z = m.bounds_max.z - m.bounds_min.z;
  return 2 * (x * y + y * z + z * x);
}

double signed_level(PackageReader& package, std::uint32_t base, double displayed_px) {
  const Manifest& m = package.manifest();
  return display_level(package.tables().planes[base], surface_of(m), m.object_height, displayed_px);
}

double combined(const QualityTable& table, double geometry, const PerGroup& losses) {
  std::vector<double> all{geometry};
  all.insert(all.end(), losses.begin(), losses.end());
  return combined_flip(table, all);
}

}  // namespace

std::vector<PlaneChoice> full_size(PackageReader& package) {
  std::vector<PlaneChoice> planes;
  for (std::uint32_t p = 0; p < full_size_planes(package.textures()); ++p) planes.push_back({p, p});
  return planes;
}

std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px,
                                            const std::array<int, kPlaneGroups>& levels) {
  std::vector<PlaneChoice> planes = full_size(package);
  for (PlaneChoice& choice : planes) {
    const auto group = static_cast<std::size_t>(group_of(package.textures()[choice.base].role));
    const double level = std::max(0.0, signed_level(package, choice.base, displayed_px));
    choice.plane = plane_at_level(package.textures(), choice.base, level + levels[group]);
  }
  return planes;
}

double texture_flip(const QualityTable& table, const PerGroup& losses) { return combined(table, 0, losses); }

double picture_flip(const QualityTable& table, double displayed_px, int scale, const PerGroup& losses) {
  return combined(table, geometry_flip(table, displayed_px, scale), losses);
}

TextureLoss::TextureLoss(PackageReader& package, double displayed_px)
    : package_(package),
      displayed_px_(displayed_px),
      curves_{GroupCurve(package.quality(), PlaneGroup::kColour, displayed_px),
              GroupCurve(package.quality(), PlaneGroup::kNormal, displayed_px),
              GroupCurve(package.quality(), PlaneGroup::kData, displayed_px)} {}

PlaneGroup TextureLoss::group_of(std::uint32_t plane) const {
  return texmesh::group_of(package_.textures()[plane].role);
}

/// What skipped fragments are to each other: the mean over the plane's surface of what the group's curve says
/// of their texels.
double TextureLoss::preview_mean(std::uint32_t plane) {
  const auto [found, is_new] = preview_means_.try_emplace(plane, 0.0);
  if (!is_new) return found->second;
  const PlaneTables& t = package_.tables().planes[plane];
  const GroupCurve& curve = curves_[static_cast<std::size_t>(group_of(plane))];
  const std::vector<float> weights = surface_weights(t);
  double sum = 0, total = 0;
  for (const std::uint16_t f : t.order) {
    sum += static_cast<double>(weights[f]) * curve.coded(static_cast<double>(t.skip_dssim[f]));
    total += static_cast<double>(weights[f]);
  }
  return found->second = total > 0 ? sum / total : 0;
}

/// FLIP of the plane's preview, which is the same for all mips of a texture.
double TextureLoss::preview_loss(std::uint32_t plane) {
  const std::vector<TextureInfo>& textures = package_.textures();
  const PlaneGroup group = group_of(plane);
  const std::uint32_t base = textures[plane].mip > 0 ? textures[plane].base : plane;
  double sum = 0, total = 0;
  for (const PlaneChoice& p : full_size(package_)) {
    if (group_of(p.plane) != group) continue;
    double weight = 0;
    const PlaneTables& t = package_.tables().planes[p.plane];
    const std::vector<float> weights = surface_weights(t);
    for (const std::uint16_t f : t.order) weight += static_cast<double>(weights[f]);
    sum += weight * preview_mean(p.plane);
    total += weight;
  }
  const double share = sum > 0 ? preview_mean(base) * total / sum : 1;
  return curves_[static_cast<std::size_t>(group)].preview() * share;
}

const TextureLoss::Plane& TextureLoss::plane(std::uint32_t plane) {
  if (plane >= package_.tables().planes.size())
    throw InputError(package_.store().name(), "texture plane " + std::to_string(plane),
                     "one of " + std::to_string(package_.tables().planes.size()), "another");
  const auto [found, is_new] = planes_.try_emplace(plane);
  Plane& out = found->second;
  if (!is_new) return out;
  const PlaneTables& t = package_.tables().planes[plane];
  const GroupCurve& curve = curves_[static_cast<std::size_t>(group_of(plane))];
  const TexelGrowth growth = this->growth(plane);
  const std::size_t fragments = t.fragment_count();
  out.weights = surface_weights(t);
  out.shown.resize((t.rung_count() + 1) * fragments);
  const double mip = this->mip(plane);
  const double mean = preview_mean(plane), preview = preview_loss(plane);
  for (const std::uint16_t f : t.order) {
    out.weight += static_cast<double>(out.weights[f]);
    out.shown[f] =
        mean > 0 ? std::min(1.0, preview * (curve.coded(static_cast<double>(t.skip_dssim[f])) / mean)) : 0;
    for (std::size_t r = 0; r < t.rung_count(); ++r) {
      const double coded = curve.coded(static_cast<double>(t.dssim[r * fragments + f]), growth);
      out.shown[(r + 1) * fragments + f] =
          mip > 0 ? combined_flip(package_.quality(), std::array{coded, mip}) : coded;
    }
  }
  return out;
}

double TextureLoss::mip(std::uint32_t plane) {
  const GroupCurve& curve = curves_[static_cast<std::size_t>(group_of(plane))];
  return curve.halved(growth(plane), package_.textures()[plane].mip);
}

PerGroup TextureLoss::weights(const std::vector<PlaneChoice>& planes) {
  PerGroup weights{};
  for (const PlaneChoice& p : planes)
    weights[static_cast<std::size_t>(group_of(p.plane))] += plane(p.plane).weight;
  return weights;
}

TexelGrowth TextureLoss::growth(std::uint32_t plane) {
  const std::vector<TextureInfo>& textures = package_.textures();
  const std::uint32_t mip = textures[plane].mip, base = mip > 0 ? textures[plane].base : plane;
  const double here = mip - signed_level(package_, base, displayed_px_);
  TexelGrowth out{};
  const SizesAround sizes = sizes_around(package_.quality(), displayed_px_);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double level = signed_level(package_, base, sizes[i]);
    out[i] = here - (textures[plane_at_level(textures, base, level)].mip - level);
  }
  return out;
}

}  // namespace texmesh
