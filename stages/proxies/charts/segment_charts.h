#pragma once
#include <cstdint>
#include <vector>

#include "format/base/vec.h"
#include "stages/base/run_context.h"
#include "stages/proxies/atlas_mesh.h"

namespace texmesh {

/// A surface cut into charts, each flattened without overlap.
struct SurfaceCharts {
  std::vector<std::uint32_t> chart_of;  // per triangle; charts are numbered by their lowest triangle
  std::uint32_t chart_count = 0;
  // Per corner 3 t + k: place in the chart's own plane, object units, y up as seen from the front. A chart's
  // area here is its area on the surface.
  std::vector<Vec2d> plane;
  // Per corner: the vertex of the atlas that it is. Corners of a vertex have one place, chart and position;
  // where a chart is cut, a position has several vertices in it.
  std::vector<std::uint32_t> vertex_of;
  std::uint32_t vertex_count = 0;
  // Per chart: the box of its places is [0, size.x] x [0, size.y], turned so that it is small.
  std::vector<Vec2d> size;
};

/// Cuts a surface into charts by merging triangles from the bottom up, and flattens each chart along its mean
/// normal, or so that angles stay. A chart is a disk of one group, which may be cut; no triangle flips, no
/// two overlap; singular values of the flattening are within 3 x of each other. Same bytes everywhere. Throws
/// Cancelled.
SurfaceCharts segment_charts(const ProxySurface& surface, const RunContext& context);

}  // namespace texmesh
