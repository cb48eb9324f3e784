#include <algorithm>
#include <cmath>

#include "stages/measure/atlas/atlas_parts.h"

namespace texmesh {
namespace {

// Smaller than this, in texels, a triangle is folded to a line: its stretch would be a play of rounding.
constexpr double kFlatTexels = 1e-6;

/// Axes of the ellipse on the texture that a circle of the surface becomes (Sander et al. 2001).
struct Axes {
  double longer = 0, shorter = 0;  // texels per object unit
};

Axes axes_of(const std::array<Vec3d, 3>& p, const std::array<Vec2d, 3>& t) {
  const Vec3d e1 = p[1] - p[0], e2 = p[2] - p[0];
  const double base = length(e1);
  // The triangle in its plane: (0, 0), (base, 0), (x, y).
  const double x = dot(e1, e2) / base, y = length(cross(e1, e2)) / base;
  const Vec2d t1 = t[1] - t[0], t2 = t[2] - t[0];
  const Vec2d along = t1 * (1 / base), across = (t2 - along * x) * (1 / y);
  const double a = dot(along, along), b = dot(along, across), c = dot(across, across);
  const double root = std::sqrt((a - c) * (a - c) + 4 * b * b);
  const double longer = std::sqrt((a + c + root) / 2);
  return {longer, std::fabs(cross(along, across)) / longer};
}

SurfacePercentiles percentiles_of(std::vector<WeighedValue>& values) {
  std::ranges::sort(values);
  return {weighed_percentile(values, 0.05), weighed_percentile(values, 0.5), weighed_percentile(values, 0.95),
          weighed_percentile(values, 0.99)};
}

}  // namespace

double weighed_percentile(std::span<const WeighedValue> sorted, double share) {
  double all = 0, sum = 0;
  for (const WeighedValue& v : sorted) all += v.weight;
  for (const WeighedValue& v : sorted) {
    sum += v.weight;
    if (sum >= share * all) return v.value;
  }
  return sorted.empty() ? 0 : sorted.back().value;
}

void measure_shape(const AtlasLayout& layout, const AtlasCharts& charts,
                   std::span<const std::uint32_t> triangles, AtlasFigures& figures) {
  std::vector<WeighedValue> density, stretch;
  double surface = 0, flat = 0;
  for (const std::uint32_t t : triangles) {
    const std::array<Vec3d, 3> p = layout.points(t);
    const double area = length(cross(p[1] - p[0], p[2] - p[0])) / 2;
    if (!(area > 0) || !std::isfinite(area)) continue;
    surface += area;
    const std::array<Vec2d, 3> at = layout.texels(t);
    const double texels = doubled_texels(at) / 2;
    const Axes axes = axes_of(p, at);
    if (!(std::fabs(texels) > kFlatTexels) || !std::isfinite(axes.longer / axes.shorter)) {
      ++figures.flat_triangles;
      flat += area;
      continue;
    }
    density.push_back({std::sqrt(std::fabs(texels) / area), area});
    stretch.push_back({axes.longer / axes.shorter, area});
    const std::uint32_t chart = charts.chart_of_triangle[t];
    if (chart != kNoIndex) figures.folded_triangles += (texels > 0) != charts.charts[chart].is_mirrored();
  }
  if (surface > 0) figures.flat_surface = flat / surface;
  figures.density = percentiles_of(density);
  figures.stretch = percentiles_of(stretch);
}

}  // namespace texmesh
