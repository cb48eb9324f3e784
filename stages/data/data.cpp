// What the artefacts of stages say of themselves.

#include "format/model/add_wedge.h"
#include "stages/data/conditioned_mesh.h"
#include "stages/data/ladder.h"
#include "stages/data/nested_scales.h"

namespace texmesh {

std::span<const std::uint8_t> fragment_stream(const LadderRung& rung, std::size_t fragment) {
  return std::span(rung.data).subspan(rung.offset[fragment],
                                      rung.offset[fragment + 1] - rung.offset[fragment]);
}

std::uint64_t bytes_to_show(const PlaneLadder& plane, std::size_t rung, std::size_t fragment) {
  std::uint64_t bytes = 0;
  for (std::size_t r = codec_traits(plane.codec).incremental ? 0 : rung; r <= rung; ++r)
    bytes += fragment_stream(plane.rungs[r], fragment).size();
  return bytes;
}

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
  for (std::uint32_t w = 0; w < wedge.size(); ++w) {
    if (wedge[w] == kNoIndex) continue;
    wedge[w] = static_cast<std::uint32_t>(out.wedge_position.size());
    add_wedge(out, in, w, position[in.wedge_position[w]]);
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

std::vector<UvSets> uv_sets_of(const std::vector<Material>& materials) {
  std::vector<UvSets> sets;
  for (const Material& m : materials) {
    UvSets s;
    bool first = true;
    for_each_texture(m, [&](const TextureRef& t) {  // the base colour comes first
      if (!t.used()) return;
      const std::uint8_t set = t.texcoord == 1 ? 1 : 0;
      if (first) s.guide = set;
      if (set != s.guide) s.both = 1;
      first = false;
    });
    sets.push_back(s);
  }
  if (std::all_of(sets.begin(), sets.end(), [](const UvSets& s) { return s == UvSets{}; })) sets.clear();
  return sets;
}

}  // namespace texmesh
