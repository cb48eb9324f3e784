#pragma once
#include "format/base/no_index.h"
#include "format/model/model.h"

namespace texmesh {

/// Per position: the lowest index of the positions that it is welded with, itself included; kNoIndex for
/// positions that are not finite. Bit-equal positions are welded (-0 equals +0), and, for distance > 0,
/// greedily by index each position with the lowest kept one within `distance`. O(n log n).
std::vector<std::uint32_t> weld_positions(const std::vector<Vec3f>& positions, double distance);

/// The unit in the last place of a float of this magnitude; 0 for 0 and for what is not finite.
float float_unit(double magnitude);

/// A position that may be at the same place as another one but for rounding.
struct RoundedPosition {
  std::uint32_t index = 0;
  float rounding = 0;       // as Mesh::rounding
  float shortest_edge = 0;  // of those that end here
};

/// Joins positions that stand in `weld` for themselves, greedily in the order of `candidates` (rising), each
/// with the lowest one kept before it that is its neighbour: every coordinate differs by at most 4 units of
/// the coarser rounding, and the distance is at most 1/16 of the shorter of the two shortest edges, so that
/// no triangle loses a corner. Changes `weld`; the result is how many were joined. O(n log n).
std::uint64_t weld_rounded(const std::vector<Vec3f>& positions,
                           const std::vector<RoundedPosition>& candidates, std::vector<std::uint32_t>& weld);

/// Per wedge: the lowest index of the wedges with the same welded position and bit-equal attributes, or
/// kNoIndex where the position has none. Only wedge_position and the attributes of `mesh` are read.
std::vector<std::uint32_t> weld_wedges(const Mesh& mesh, const std::vector<std::uint32_t>& position_weld);

}  // namespace texmesh
