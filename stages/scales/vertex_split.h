#pragma once
#include "format/split/split_writer.h"
#include "stages/scales/scale_codecs.h"

namespace texmesh {

/// How the values of a stream are rounded. Texture coordinates and colours of the mesh that are not to be in
/// it have 0 bits.
struct VertexSplitCoding {
  QuantisationGrid position;  // 1 to 24 bits
  QuantisationGrid uv[2];
  int normal_bits = 10, colour_bits = 0;
  bool merge_parts = false;  // all parts as part 0
};

/// The collapses between the given scales (indices into NestedScales::scales, S_0 first) turned round, for
/// write_split_stream. The coarsest of them is the first patch. Collapses are replayed; where a face's wedge
/// between two scales is not known it is the one that the removed faces suggest, and at every given scale it
/// is exactly that scale's. What a scale lacks that no collapse explains (components that vanish) is a patch
/// of the next finer one. Twins are one point; wedges of a point that are equal after rounding are one.
/// Deterministic. Time grows with triangles and with the triangles that collapses move. Throws StageError
/// when collapses and scales do not belong together.
SplitSource make_vertex_splits(const NestedScales& scales, const std::vector<std::size_t>& kept,
                               const VertexSplitCoding& coding, const RunContext& context);

}  // namespace texmesh
