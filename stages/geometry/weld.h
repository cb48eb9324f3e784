#pragma once
#include "format/base/no_index.h"
#include "format/model/model.h"

namespace texmesh {

/// Per position: the lowest index of the positions that it is welded with, itself included; kNoIndex for
/// positions that are not finite. Bit-equal positions are welded (-0 equals +0), and, for distance > 0,
/// greedily by index each position with the lowest kept one within `distance`. O(n log n).
std::vector<std::uint32_t> weld_positions(const std::vector<Vec3f>& positions, double distance);

/// Per wedge: the lowest index of the wedges with the same welded position and bit-equal attributes, or
/// kNoIndex where the position has none. Only wedge_position and the attributes of `mesh` are read.
std::vector<std::uint32_t> weld_wedges(const Mesh& mesh, const std::vector<std::uint32_t>& position_weld);

}  // namespace texmesh
