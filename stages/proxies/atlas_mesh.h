#pragma once
#include <cstdint>
#include <vector>

#include "format/base/vec.h"
#include "format/model/model.h"

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

}  // namespace texmesh
