#include "stages/measure/atlas/atlas_figures.h"

#include <algorithm>
#include <cmath>

#include "stages/measure/atlas/atlas_parts.h"

namespace texmesh {
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
