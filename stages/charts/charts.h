#pragma once
// A surface cut into charts, which are packed into an atlas.
#include <optional>
#include <span>

#include "format/model/model.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// A triangle soup whose equal positions are one. A group is a class of materials that must stay apart, such
/// as unlit, blended or double-sided ones: no chart holds triangles of two groups.
struct ProxySurface {
  std::vector<Vec3f> positions;      // the model's frame, object units; each in use, none twice
  std::vector<Triangle> triangles;   // indices of positions; three different ones each, area above 0
  std::vector<std::uint32_t> group;  // per triangle; small numbers chosen by the caller
  friend bool operator==(const ProxySurface&, const ProxySurface&) = default;
};

/// A coarse mesh of a model's surface with an atlas of its own, for a texture of width_px x height_px.
/// - Charts do not overlap: at least gutter_px texels lie between the texels that two charts touch. There is
///   no gutter at the texture's border, so it is read with clamped coordinates.
/// - No chart is mirrored: who looks at a front face sees u grow to the right when v grows down. So
///   cross(uv1 - uv0, uv2 - uv0) < 0 for every triangle.
/// - A vertex belongs to one chart, a chart to one group.
struct AtlasMesh {
  std::vector<Vec3f> positions;            // per vertex, model's frame; repeated where charts end
  std::vector<Vec2f> uvs;                  // per vertex, 0..1, v down as in glTF
  std::vector<std::uint32_t> position_of;  // per vertex: index into ProxySurface::positions
  std::vector<Triangle> triangles;         // indices of vertices; wound as S_0, in ProxySurface's order
  std::vector<std::uint32_t> chart_of;     // per triangle
  std::vector<std::uint32_t> group_of;     // per triangle, as ProxySurface::group
  std::uint32_t chart_count = 0;
  std::uint32_t width_px = 0, height_px = 0, gutter_px = 0;
  friend bool operator==(const AtlasMesh&, const AtlasMesh&) = default;
};

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

/// What flattening may do to a chart.
struct ChartLimits {
  double stretch = 1.25;  // L2 of Sander et al. 2001: the root of the mean squared stretch, 1 for a plane
  double ratio = 3;       // of a triangle's singular values, and of one to the chart's mean
};

/// Cuts a surface into charts by merging triangles from the bottom up, and flattens each chart along its mean
/// normal, or so that angles stay. A chart is a disk of one group, which may be cut; no triangle flips, no
/// two overlap; the flattening keeps the limits. Same bytes everywhere. Throws Cancelled.
SurfaceCharts segment_charts(const ProxySurface& surface, const RunContext& context,
                             const ChartLimits& limits = {});

/// Packs charts into a texture of width_px x height_px (1..16384 each) with texels of one size as far as
/// whole texels allow. nullopt when there are more charts than a texture of this size can hold: a larger
/// texture, or fewer triangles, will do. Same bytes everywhere. Throws Cancelled.
std::optional<AtlasMesh> pack_atlas(const ProxySurface& surface, const SurfaceCharts& charts,
                                    std::uint32_t width_px, std::uint32_t height_px, std::uint32_t gutter_px,
                                    const RunContext& context);

}  // namespace texmesh
