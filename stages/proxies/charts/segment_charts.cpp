#include "stages/proxies/charts/segment_charts.h"

#include <algorithm>
#include <cstddef>

#include "format/base/no_index.h"
#include "stages/proxies/charts/chart_merge.h"
#include "stages/proxies/charts/flat_chart.h"

namespace texmesh {
namespace {

/// Turns a chart so that the box around it is small, and moves the box to the origin.
void turn_chart(const GrowingChart& chart, const std::vector<Vec2d>& places, SurfaceCharts& out) {
  std::vector<Vec2d> points;
  for (const std::uint32_t t : chart.triangles)
    for (std::size_t k = 0; k < 3; ++k) points.push_back(places[3 * std::size_t{t} + k]);
  const Vec2d side = smallest_box_side(points);
  for (Vec2d& p : points) p = {dot(side, p), cross(side, p)};
  Vec2d low = points[0], high = points[0];
  for (const Vec2d p : points) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y)};
  }
  for (std::size_t i = 0; i < points.size(); ++i)
    out.plane[3 * std::size_t{chart.triangles[i / 3]} + i % 3] = points[i] - low;
  out.size.push_back(high - low);
}

}  // namespace

SurfaceCharts segment_charts(const ProxySurface& surface, const RunContext& context) {
  ChartMerge merge(surface);
  merge.run(context);
  std::vector<std::uint32_t> chart_of(surface.triangles.size());
  for (std::uint32_t c = 0; c < merge.charts().size(); ++c)
    for (const std::uint32_t t : merge.charts()[c].triangles) chart_of[t] = c;

  SurfaceCharts out;
  out.chart_of.resize(surface.triangles.size());
  out.plane.resize(3 * surface.triangles.size());
  std::vector<std::uint32_t> number(merge.charts().size(), kNoIndex);
  for (std::size_t t = 0; t < chart_of.size(); ++t) {
    if (number[chart_of[t]] == kNoIndex) {
      number[chart_of[t]] = out.chart_count++;
      turn_chart(merge.charts()[chart_of[t]], merge.layout().places(), out);
    }
    out.chart_of[t] = number[chart_of[t]];
  }
  out.vertex_of.resize(out.plane.size());
  std::vector<std::uint32_t> vertex(out.plane.size(), kNoIndex);
  for (std::size_t c = 0; c < out.plane.size(); ++c) {
    std::uint32_t& renumbered = vertex[merge.vertices()[c]];
    if (renumbered == kNoIndex) renumbered = out.vertex_count++;
    out.vertex_of[c] = renumbered;
  }
  return out;
}

}  // namespace texmesh
