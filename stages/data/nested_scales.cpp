#include "stages/data/nested_scales.h"

#include "format/base/no_index.h"

namespace texmesh {

Mesh extract_scale(const NestedScales& scales, const NestedScale& scale) {
  const Mesh& in = scales.mesh;
  std::vector<std::uint32_t> wedge(in.wedge_count(), kNoIndex), position(in.positions.size(), kNoIndex);
  for (const Triangle& t : scale.triangles)
    for (std::uint32_t w : t) wedge[w] = position[in.wedge_position[w]] = 0;
  Mesh out;
  out.origin = in.origin;
  out.part_names = in.part_names;
  for (std::size_t p = 0; p < position.size(); ++p) {
    if (position[p] == kNoIndex) continue;
    position[p] = static_cast<std::uint32_t>(out.positions.size());
    out.positions.push_back(in.positions[p]);
  }
  for (std::size_t w = 0; w < wedge.size(); ++w) {
    if (wedge[w] == kNoIndex) continue;
    wedge[w] = static_cast<std::uint32_t>(out.wedge_position.size());
    out.wedge_position.push_back(position[in.wedge_position[w]]);
    auto keep = [w](const auto& from, auto& to) {
      if (!from.empty()) to.push_back(from[w]);
    };
    keep(in.uv0, out.uv0), keep(in.uv1, out.uv1), keep(in.normals, out.normals),
        keep(in.colours, out.colours), keep(in.tangents, out.tangents);
  }
  out.triangles.reserve(scale.triangles.size());
  for (std::size_t i = 0; i < scale.triangles.size(); ++i) {
    const Triangle& t = scale.triangles[i];
    out.triangles.push_back({wedge[t[0]], wedge[t[1]], wedge[t[2]]});
    out.triangle_material.push_back(in.triangle_material[scale.triangle_source[i]]);
    out.triangle_part.push_back(in.triangle_part[scale.triangle_source[i]]);
  }
  return out;
}

}  // namespace texmesh
