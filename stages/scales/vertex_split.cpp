#include "stages/scales/vertex_split.h"

#include <algorithm>
#include <map>

#include "format/base/errors.h"
#include "stages/scales/collapse_replay.h"
#include "stages/scales/rounded_mesh.h"

namespace texmesh {
namespace {

[[noreturn]] void fail(const std::string& place, const std::string& expected, const std::string& found) {
  throw StageError("scales", place, expected, found);
}

void add_groups(const Mesh& mesh, bool merge_parts, SplitSource& source) {
  std::map<std::array<std::uint16_t, 2>, std::uint16_t> index;
  for (std::size_t f = 0; f < mesh.triangles.size(); ++f) {
    const std::array<std::uint16_t, 2> key{mesh.triangle_material[f],
                                           merge_parts ? std::uint16_t{0} : mesh.triangle_part[f]};
    const auto [at, added] = index.try_emplace(key, static_cast<std::uint16_t>(source.groups.size()));
    if (added) source.groups.push_back({key[0], key[1]});
    if (source.groups.size() > 65535) fail("materials and parts", "at most 65535 pairs", "more");
    source.face_group.push_back(at->second);
  }
}

}  // namespace

SplitSource make_vertex_splits(const NestedScales& scales, const std::vector<std::size_t>& kept,
                               const VertexSplitCoding& coding, const RunContext& context) {
  if (kept.empty() || kept[0] != 0) fail("kept scales", "S_0 first", "another");
  SplitSource source;
  add_groups(scales.mesh, coding.merge_parts, source);
  RoundedMesh rounded(scales, coding);
  CollapseReplay replay(scales, rounded);
  for (std::size_t i = 1; i < kept.size(); ++i) {
    context.check_cancelled();
    source.chapters.push_back(replay.run(scales.scales.at(kept[i - 1]), scales.scales.at(kept[i])));
  }
  source.chapters.push_back(replay.remaining_faces(scales.scales.at(kept.back()).scale));
  std::reverse(source.chapters.begin(), source.chapters.end());
  rounded.move_to(source);
  return source;
}

}  // namespace texmesh
