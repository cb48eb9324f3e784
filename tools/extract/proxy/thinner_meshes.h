#pragma once
#include <vector>

#include "format/model/model.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// The mesh, and behind it coarser ones in the same atlas, each with about four fifths of the vertices of the
/// one before, down to a fifth. Fewer where collapses end: charts stay, and borders keep together. Same
/// result for any thread count.
std::vector<Mesh> thinner_meshes(const Mesh& mesh, const RunContext& context);

}  // namespace texmesh
