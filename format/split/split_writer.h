#pragma once

#include "format/split/split_source.h"

namespace texmesh {

/// Same bytes for the same source. FormatError when the source contradicts itself: splits that wait for each
/// other, faces that are not at their parent, indices or numbers out of range.
std::vector<std::uint8_t> write_split_stream(const SplitSource& source);

}  // namespace texmesh
