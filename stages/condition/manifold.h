#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/model/model.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {

/// What split_non_manifold needs to know to pair the triangles of an edge that more than two share.
struct Surface {
  std::span<const Vec3f> positions;
  std::span<const Triangle> wedges;                // per triangle: the same corners with their attributes
  std::span<const std::uint16_t> material;         // per triangle
  std::span<const std::uint32_t> corner_position;  // three per triangle, all different
};

struct ManifoldSplit {
  std::vector<std::uint32_t> corner_position;  // as Surface's, with new numbers for positions that were split
  // Per new number (position_count, position_count + 1 and so on): the old one.
  std::vector<std::uint32_t> split_from;
  std::uint64_t non_manifold_edges = 0;  // edges of more than two triangles, or of two that disagree on front
  std::uint64_t bow_ties = 0;            // positions split although none of their edges is non-manifold
};

/// Gives every fan of triangles around a position a position of its own. The result is an oriented 2-manifold
/// with boundary: an edge has one triangle, or two that run through it in opposite directions, and the
/// triangles of a position form one fan.
/// - Where more triangles meet at an edge, the pairs that agree best in wedges, material and direction stay
///   together.
/// - The two triangles of a two-sided sheet are never joined to each other.
/// - The fan with the lowest triangle keeps the old number. Nothing moves.
/// O(n log n).
ManifoldSplit split_non_manifold(const Surface& surface, const EdgeTable& edges);

}  // namespace texmesh
