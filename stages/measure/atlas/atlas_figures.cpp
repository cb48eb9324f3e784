// What one image of a model is like as an atlas: where triangles lie on it, how they are stretched there, and
// what charts, seams (atlas_charts.cpp) and cover (atlas_cover.cpp) add up to.

#include <algorithm>

#include "stages/measure/atlas/atlas_parts.h"

namespace texmesh {
namespace {

/// Base colour's texture; without one, the first that is used.
TextureRef guide_of(const Material& material, const Mesh& mesh, std::span<const AtlasImage> images) {
  TextureRef guide;
  for_each_texture(material, [&](const TextureRef& t) {
    const bool has_uv = t.texcoord == 1 ? !mesh.uv1.empty() : t.texcoord == 0 && !mesh.uv0.empty();
    if (guide.used() || !t.used() || !has_uv) return;
    const auto image = static_cast<std::size_t>(t.image);
    if (image < images.size() && images[image].width_px > 0 && images[image].height_px > 0) guide = t;
  });
  return guide;
}

}  // namespace

AtlasLayout::AtlasLayout(const Mesh& mesh, const std::vector<Material>& materials,
                         std::span<const AtlasImage> images)
    : mesh_(mesh) {
  for (const Material& m : materials) {
    guide_.push_back(guide_of(m, mesh, images));
    const TextureRef& g = guide_.back();
    const AtlasImage image = g.used() ? images[static_cast<std::size_t>(g.image)] : AtlasImage{1, 1, nullptr};
    map_.emplace_back(g.transform, image.width_px, image.height_px);
  }
}

std::array<Vec2d, 3> AtlasLayout::texels(std::uint32_t triangle) const {
  const TexelMap& map = map_[mesh_.triangle_material[triangle]];
  return {map(uv(triangle, 0)), map(uv(triangle, 1)), map(uv(triangle, 2))};
}

std::array<Vec3d, 3> AtlasLayout::points(std::uint32_t triangle) const {
  const auto at = [&](int k) { return to_double(mesh_.positions[mesh_.position_of(triangle, k)]); };
  return {at(0), at(1), at(2)};
}

double doubled_texels(const std::array<Vec2d, 3>& corners) {
  const double twice = cross(corners[1] - corners[0], corners[2] - corners[0]);
  return std::isfinite(twice) ? twice : 0;
}

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

namespace {

/// One of every image that triangles show.
std::vector<AtlasFigures> list_atlases(const AtlasLayout& layout, std::span<const AtlasImage> images) {
  std::vector<bool> shown(images.size());
  for (std::uint32_t t = 0; t < layout.mesh().triangles.size(); ++t)
    if (const TextureRef* texture = layout.texture(t)) shown[static_cast<std::size_t>(texture->image)] = true;
  std::vector<AtlasFigures> atlases;
  for (std::uint32_t i = 0; i < images.size(); ++i) {
    if (!shown[i]) continue;
    AtlasFigures figures;
    figures.image = i;
    figures.width_px = images[i].width_px, figures.height_px = images[i].height_px;
    for (std::uint32_t m = 0; m < layout.guides().size(); ++m)
      if (layout.guides()[m].image == static_cast<std::int32_t>(i)) figures.materials.push_back(m);
    atlases.push_back(std::move(figures));
  }
  return atlases;
}

std::vector<std::uint32_t> atlases_of_triangles(const AtlasLayout& layout,
                                                const std::vector<AtlasFigures>& atlases) {
  std::vector<std::uint32_t> of_material(layout.guides().size(), kNoIndex);
  for (std::uint32_t a = 0; a < atlases.size(); ++a)
    for (const std::uint32_t m : atlases[a].materials) of_material[m] = a;
  std::vector<std::uint32_t> out;
  for (const std::uint16_t m : layout.mesh().triangle_material) out.push_back(of_material[m]);
  return out;
}

/// What the charts of every atlas add up to.
void sum_charts(const AtlasCharts& charts, std::vector<AtlasFigures>& atlases) {
  std::vector<double> texels(atlases.size());
  for (const ChartFigures& c : charts.charts) {
    AtlasFigures& a = atlases[c.atlas];
    ++a.charts;
    a.small_charts += c.triangles <= kSmallChart;
    a.thin_charts += c.is_thin();
    a.mirrored_charts += c.is_mirrored();
    a.triangle_floor += c.corners > 3 ? c.corners - 2 : 1;
    a.largest_chart = std::max(a.largest_chart, c.texels);
    a.thin_share += c.is_thin() ? c.texels : 0;
    texels[c.atlas] += c.texels;
  }
  for (std::size_t a = 0; a < atlases.size(); ++a) {
    const double scale = texels[a] > 0 ? 1 / texels[a] : 0;
    atlases[a].largest_chart *= scale, atlases[a].thin_share *= scale;
    const AtlasCharts::Counts& n = charts.counts[a];
    atlases[a].edges = n.edges, atlases[a].seam_edges = n.seam_edges;
    atlases[a].positions = n.positions, atlases[a].vertices = n.vertices;
  }
}

}  // namespace

double ChartFigures::width_texels() const {
  const double half = border_texels / 2, root = half * half - 4 * texels;
  return root > 0 ? 2 * texels / (half + std::sqrt(root)) : std::sqrt(texels);
}

AtlasReport measure_atlases(const Mesh& mesh, const std::vector<Material>& materials,
                            std::span<const AtlasImage> images, const RunContext& context) {
  const AtlasLayout layout(mesh, materials, images);
  AtlasReport report;
  report.atlases = list_atlases(layout, images);
  const std::vector<std::uint32_t> atlas_of = atlases_of_triangles(layout, report.atlases);
  std::vector<std::vector<std::uint32_t>> triangles(report.atlases.size());
  for (std::uint32_t t = 0; t < atlas_of.size(); ++t) {
    if (atlas_of[t] == kNoIndex)
      ++report.untextured_triangles;
    else
      triangles[atlas_of[t]].push_back(t);
  }
  AtlasCharts charts = find_charts(layout, atlas_of, report.atlases.size());
  sum_charts(charts, report.atlases);
  const auto seams = measure_seams(layout, charts, images, report.atlases.size(), context);
  for (std::size_t a = 0; a < report.atlases.size(); ++a) {
    AtlasFigures& figures = report.atlases[a];
    figures.triangles = triangles[a].size();
    figures.seam_colours = seams[a];
    measure_shape(layout, charts, triangles[a], figures);
    measure_cover(layout, triangles[a], figures, context);
  }
  report.charts = std::move(charts.charts);
  report.chart_of_triangle = std::move(charts.chart_of_triangle);
  return report;
}

}  // namespace texmesh
