#pragma once
#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

/// Puts a point where its texture coordinates lie among those of its neighbours (SplitFill::kTexture); leaves
/// it where it is when they say nothing.
void fill_lost_point(const SplitStreamHead& head, SplitMesh& mesh, std::uint32_t point);

}  // namespace texmesh
