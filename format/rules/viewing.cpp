#include "format/rules/viewing.h"

#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"

namespace texmesh {
namespace {

/// A coarser scale that is enough at any size stops just below, because the last step is always S_0's.
constexpr double kBelowAny = 0.999 * kAnyDisplayPx;
/// Keeps steps apart in the manifest's six digits.
constexpr double kApart = 1.0001;

double half_tangent(double degrees) {
  const double half = degrees * (portable::kPi / 360);
  return portable::sin(half) / portable::cos(half);
}

void require_viewing(bool good, const char* place, const char* expected, double found) {
  if (!good) throw FormatError("viewing", place, expected, std::to_string(found));
}

/// Between the O_V / E_S of two scales the better match is the one whose ratio is nearer: their geometric
/// mean parts them.
double edge_limit(std::span<const ManifestScale> scales, std::size_t k) {
  return std::sqrt(scales[k].display_px_edge * scales[k - 1].display_px_edge);
}

/// S_0's O_V / E_S is not in the manifest: it has no step to a finer scale. What it would be is estimated
/// from the number of triangles, which grows with the square of edges per length.
double edge_limit_of_first(std::span<const ManifestScale> scales) {
  const double ratio = std::sqrt(static_cast<double>(scales[0].triangles) /
                                 static_cast<double>(std::max(scales[1].triangles, 1u)));
  return scales[1].display_px_edge * std::sqrt(std::max(ratio, 1.0));
}

/// A tier is shown from the distance of its first scale on, which is the one behind the major scale before.
double distance_limit(std::span<const ManifestScale> scales, std::size_t k) {
  if (!scales[k].major) return 0;
  std::size_t before = k - 1;
  while (before > 0 && !scales[before].major) --before;
  double px = kFirstDistancePx;
  for (int i = scales[before].scale; i > 0; --i) px /= kDistanceStep;
  return px;
}

double limit_of(std::span<const ManifestScale> scales, std::size_t k, StepRule rule) {
  if (rule == StepRule::kJnd) return scales[k].display_px_jnd;
  if (rule == StepRule::kError) return scales[k].display_px_error;
  if (rule == StepRule::kFlip) return scales[k].display_px_flip;
  if (rule == StepRule::kDistance) return distance_limit(scales, k);
  return k == 1 ? edge_limit_of_first(scales) : edge_limit(scales, k);
}

/// By how much a relative distance grows when R can be no more than half the part's shorter side.
double growth_of_value(const ManifestScale& s, double displayed_px, const VisiblePart& part) {
  if (!(s.p95 > 0) || s.display_px_error >= kAnyDisplayPx) return 1;
  const double half_width_px = std::min(part.width_px, part.height_px) / 2;
  const double value = displayed_px / s.display_px_error / half_width_px;
  return std::max(1.0, value / s.p95);
}

bool accepts(std::span<const ManifestScale> scales, std::size_t k, double displayed_px,
             const VisiblePart& part, StepRule rule) {
  const ManifestScale& s = scales[k];
  if (rule == StepRule::kJnd)
    return std::max(part.width_px, part.height_px) * growth_of_value(s, displayed_px, part) <=
           s.display_px_jnd;
  const double growth = rule == StepRule::kDistance ? growth_of_value(s, displayed_px, part) : 1;
  return displayed_px * growth <= limit_of(scales, k, rule);
}

}  // namespace

double displayed_height_px(double object_height, double distance, const Camera& camera) {
  require_viewing(distance > 0, "distance", "> 0", distance);
  require_viewing(camera.fov_degrees > 0 && camera.fov_degrees < 180, "field of view", "0 .. 180 degrees",
                  camera.fov_degrees);
  return object_height / (2 * distance * half_tangent(camera.fov_degrees)) * camera.viewport_px;
}

double viewing_distance(double object_height, double height_px, const Camera& camera) {
  require_viewing(camera.fov_degrees > 0 && camera.fov_degrees < 180, "field of view", "0 .. 180 degrees",
                  camera.fov_degrees);
  if (height_px >= kAnyDisplayPx) return 0;
  if (!(height_px > 0)) return std::numeric_limits<double>::infinity();
  return object_height / (2 * height_px * half_tangent(camera.fov_degrees)) * camera.viewport_px;
}

std::vector<ManifestStep> step_function(std::span<const ManifestScale> scales, StepRule rule) {
  std::vector<ManifestStep> steps;
  double reached = 0;
  for (std::size_t k = scales.size(); k-- > 0;) {
    const double limit = k == 0 ? kAnyDisplayPx : std::min(limit_of(scales, k, rule), kBelowAny);
    if (limit <= reached * kApart) continue;
    steps.push_back({limit, scales[k].scale});
    reached = limit;
  }
  return steps;
}

int scale_at(std::span<const ManifestStep> steps, double displayed_px) {
  for (const ManifestStep& step : steps)
    if (displayed_px <= step.up_to_px) return step.scale;
  return steps.empty() ? 0 : steps.back().scale;
}

int finest_shown(std::span<const ManifestScale> scales, double displayed_px) {
  for (const ManifestScale& s : scales)
    if (s.triangles * kLeastTrianglePx2 <= displayed_px * displayed_px) return s.scale;
  return scales.empty() ? 0 : scales.back().scale;
}

int select_scale(const Manifest& manifest, double displayed_px, const VisiblePart& part, StepRule rule) {
  const std::span<const ManifestScale> scales = manifest.scales;
  if (!part.clipped) return scale_at(step_function(scales, rule), displayed_px);
  if (!(part.width_px > 0 && part.height_px > 0)) return scales.back().scale;
  for (std::size_t k = scales.size(); k-- > 1;)
    if (accepts(scales, k, displayed_px, part, rule)) return scales[k].scale;
  return scales.front().scale;
}

double display_level(const PlaneTables& full_size, double surface_area, double object_height,
                     double displayed_px) {
  double texels = 0, surface = 0;
  for (std::size_t f = 0; f < full_size.fragment_count(); ++f) {
    texels += full_size.covered_texels[f];
    surface += full_size.surface_fraction[f];
  }
  if (!(surface > 0) || !(surface_area > 0) || !(texels > 0)) return 0;
  const double texels_per_unit = std::sqrt(texels / (surface * surface_area));
  return portable::log(texels_per_unit / (displayed_px / object_height)) / portable::kLn2;
}

std::uint32_t plane_at_level(std::span<const TextureInfo> textures, std::uint32_t base, double level) {
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

std::vector<OrdinaryLoad> ordinary_loads(std::size_t count) {
  std::vector<OrdinaryLoad> out;
  SplitMix random(18);
  // Logarithms are equally likely.
  const auto between = [&random](double least, double most) {
    return least * portable::exp(random.next() * portable::log(most / least));
  };
  for (std::size_t k = 0; k < count; ++k) {
    OrdinaryLoad load;
    load.bytes_s = between(2e6, 50e6) / 8;
    load.displayed_px = between(200, 2000);
    load.time_limit_s = between(1, 10);
    out.push_back(load);
  }
  return out;
}

}  // namespace texmesh
