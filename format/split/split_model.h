#pragma once
#include "format/model/model.h"
#include "format/split/split_mesh.h"
#include "format/split/split_stream.h"

namespace texmesh {

/// The visible faces of a mesh that a stream has built, with the values that the head's grids give its
/// places. Points and wedges are numbered by their first use. Parts have the numbers of the head's groups and
/// no names.
Mesh split_model(const SplitStreamHead& head, const SplitMesh& mesh);

}  // namespace texmesh
