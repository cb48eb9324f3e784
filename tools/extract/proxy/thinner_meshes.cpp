#include "tools/extract/proxy/thinner_meshes.h"

#include "format/base/errors.h"
#include "stages/condition/condition.h"
#include "stages/simplification/simplification.h"

namespace texmesh {
namespace {

constexpr double kVertexShare = 0.8;
constexpr int kThinnerMeshes = 7;

/// Asks for falling numbers of vertices, whichever they are.
ScaleMap falling_counts(std::size_t positions) {
  ScaleMap out;
  out.scales = kThinnerMeshes;
  for (std::size_t p = 0; p < positions; ++p) {
    std::uint8_t last = 0;
    for (double count = kVertexShare * static_cast<double>(positions);
         last < kThinnerMeshes && static_cast<double>(p) < count; count *= kVertexShare)
      ++last;
    out.persistence.push_back(last);
  }
  return out;
}

SimplificationOptions by_shape_alone() {
  SimplificationOptions out;
  out.persistence_weight = 0;
  out.coarsest = 1;
  out.coarsest_vertices = 0;
  return out;
}

}  // namespace

std::vector<Mesh> thinner_meshes(const Mesh& mesh, const RunContext& context) {
  RunContext inner = context;
  inner.progress = nullptr;
  std::vector<Mesh> out{mesh};
  try {
    ConditionOptions as_it_is;
    as_it_is.normals = NormalsPolicy::kKeep;
    const ConditionedMesh sound = condition_mesh(mesh, true, as_it_is, inner);
    const NestedScales scales =
        simplify(sound, falling_counts(sound.mesh.positions.size()), by_shape_alone(), inner);
    for (std::size_t k = 1; k < scales.scales.size(); ++k)
      out.push_back(extract_scale(scales, scales.scales[k]));
  } catch (const StageError&) {  // a mesh without area
  }
  return out;
}

}  // namespace texmesh
