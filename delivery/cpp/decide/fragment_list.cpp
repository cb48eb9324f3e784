#include "delivery/cpp/decide/fragment_list.h"

#include <algorithm>
#include <cmath>

#include "format/base/errors.h"
#include "format/base/portable_math.h"
#include "format/documents/allocation.h"
#include "format/documents/rate_distortion.h"
#include "format/documents/size_curve.h"

namespace texmesh {
namespace {

constexpr double kLn2 = 0.693147180559945309417, kMipExponent = 1.45;
constexpr int kMostCoarser = 4;                // levels below the display's that are tried
constexpr double kLossUnit = 1099511627776.0;  // 2^40: losses as spend_bytes counts them

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

/// Area of the object; where the package does not say it that of the bounding box. Object units squared.
double surface_of(const Manifest& m) {
  if (m.surface_area > 0) return m.surface_area;
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
    const double skipped = t.skip_dssim.empty() ? 1.0 : static_cast<double>(t.skip_dssim[f]);
    o.loss.push_back(weight * skipped);
    bool stored = true, shows_more = false;
    for (std::size_t r = 0; r < t.rung_count(); ++r) {
      const std::uint64_t bytes = bytes_to_show(t, r, f);
      stored = stored && bytes > 0 && bytes <= 0xffffffffu;
      o.bytes.push_back(static_cast<std::uint32_t>(bytes));
      const double dssim = static_cast<double>(t.dssim[r * t.fragment_count() + f]);
      o.loss.push_back(weight * dssim);
      shows_more = shows_more || dssim < skipped;
    }
    if (!stored) continue;
    list.total_weight += weight;
    if (!shows_more) {
      list.preview_loss += o.loss[0];
      continue;
    }
    o.eta = eta[f] * weight;
    o.planned_bytes = std::max(1.0, interpolated_bytes(t, f, quality[f]));
    o.low_rung = std::min(low, high);
    o.high_rung = high;
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

namespace {

/// How often the texels of a full-size plane may be halved until one stands for a pixel: log2 of texels per
/// pixel, along a line.
double display_level(PackageReader& package, std::uint32_t base, double displayed_px) {
  const Manifest& m = package.manifest();
  const Cover cover = cover_of(package.tables().planes[base]);
  const double surface = surface_of(m);
  if (!(cover.surface > 0) || !(surface > 0) || !(cover.texels > 0)) return 0;
  const double texels_per_unit = std::sqrt(cover.texels / (cover.surface * surface));
  return portable::log(texels_per_unit / (displayed_px / m.object_height)) / kLn2;
}

/// The plane of a texture with the largest mip that is at most `level`.
std::uint32_t plane_at(const std::vector<TextureInfo>& textures, std::uint32_t base, double level) {
  std::uint32_t best = base, best_mip = 0;
  for (std::uint32_t p = 0; p < textures.size(); ++p) {
    const TextureInfo& t = textures[p];
    // A plane may lack its larger mips (small textures have none).
    if (t.mip == 0 || t.base != base || t.mip <= best_mip || static_cast<double>(t.mip) > level) continue;
    best_mip = t.mip;
    best = p;
  }
  return best;
}

/// Levels below the display's: of base colours and of everything else, which often costs more and shows less.
struct Coarser {
  int colour = 0, other = 0;
};
std::vector<PlaneChoice> planes_at(PackageReader& package, double displayed_px, Coarser coarser) {
  std::vector<PlaneChoice> planes = full_size(package);
  for (PlaneChoice& choice : planes) {
    const bool colour = role_weight(package.textures()[choice.base].role) == 1;
    choice.plane = plane_at(package.textures(), choice.base,
                            std::max(0.0, display_level(package, choice.base, displayed_px)) +
                                (colour ? coarser.colour : coarser.other));
  }
  return planes;
}

/// Surface-weighted mean of what the previews lose.
double preview_loss(const PlaneTables& t) {
  if (t.skip_dssim.empty()) return 1;
  const std::vector<float> weights = surface_weights(t);
  double sum = 0, weight = 0;
  for (const std::uint16_t f : t.order) {
    sum += static_cast<double>(weights[f]) * t.skip_dssim[f];
    weight += weights[f];
  }
  return weight > 0 ? sum / weight : 0;
}

/// Spends the bytes on these planes.
TextureBudget spend_on(PackageReader& package, std::vector<PlaneChoice> planes, double displayed_px,
                       const ListOptions& options, std::uint64_t bytes) {
  TextureBudget out;
  out.list = fragment_list(package, planes, options);
  const double total = std::max(out.list.total_weight, 1e-300);
  std::vector<RdCurve> curves;
  for (const FragmentOffer& f : out.list.offers) {
    RdCurve curve{{0}, {}};
    curve.bytes.insert(curve.bytes.end(), f.bytes.begin(), f.bytes.end());
    for (const double loss : f.loss)
      curve.loss.push_back(static_cast<std::uint64_t>(loss / total * kLossUnit));
    curves.push_back(std::move(curve));
  }
  double loss = out.list.preview_loss;
  const std::vector<std::uint32_t> ways = spend_bytes(curves, bytes);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    out.rungs.push_back(static_cast<std::int32_t>(ways[i]) - 1);
    out.bytes += curves[i].bytes[ways[i]];
    loss += out.list.offers[i].loss[ways[i]];
  }
  out.dssim = 1 - (1 - loss / total) * (1 - mip_loss(package, planes, displayed_px));
  out.planes = std::move(planes);
  return out;
}

}  // namespace

std::vector<PlaneChoice> planes_for_display(PackageReader& package, double displayed_px) {
  return planes_at(package, displayed_px, {});
}

double mip_loss(PackageReader& package, const std::vector<PlaneChoice>& planes, double displayed_px) {
  double loss = 0, weight = 0;
  for (const PlaneChoice& choice : planes) {
    const TextureInfo &base = package.textures()[choice.base], &shown = package.textures()[choice.plane];
    const PlaneTables& t = package.tables().planes[choice.base];
    const double w = role_weight(base.role) * cover_of(t).surface;
    weight += w;
    if (shown.mip == 0) continue;
    const double display = std::max(0.0, display_level(package, choice.base, displayed_px));
    const double preview = portable::log(static_cast<double>(base.width_px) / base.preview_width_px) / kLn2;
    const double missing = static_cast<double>(shown.mip) - display, all = preview - display;
    if (missing <= 0) continue;
    loss += w * preview_loss(t) * (missing < all ? portable::pow(missing / all, kMipExponent) : 1);
  }
  return weight > 0 ? std::min(1.0, loss / weight) : 0;
}

TextureBudget texture_for_budget(PackageReader& package, double displayed_px, const ListOptions& options,
                                 std::uint64_t bytes) {
  Coarser at;
  const auto spend = [&](const Coarser& c) {
    return spend_on(package, planes_at(package, displayed_px, c), displayed_px, options, bytes);
  };
  TextureBudget best = spend(at);
  for (bool better = true; better;) {  // downhill; every step makes something coarser
    better = false;
    const Coarser from = at;
    for (const Coarser& step : {Coarser{1, 1}, Coarser{0, 1}, Coarser{1, 0}}) {
      const Coarser to{from.colour + step.colour, from.other + step.other};
      if (std::max(to.colour, to.other) > kMostCoarser) continue;
      TextureBudget now = spend(to);
      if (now.dssim >= best.dssim) continue;
      best = std::move(now);
      at = to;
      better = true;
    }
  }
  return best;
}

}  // namespace texmesh
