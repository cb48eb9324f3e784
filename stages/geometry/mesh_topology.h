#pragma once
#include <span>

#include "format/model/model.h"

namespace texmesh {

/// The undirected edges of a triangle soup, each with its half-edges. Half-edge 3 t + k runs from corner k of
/// triangle t to its corner (k + 1) % 3. Edges are sorted by their lower, then by their higher end;
/// half-edges by number.
struct EdgeTable {
  std::vector<std::uint32_t> half_edges;  // grouped by edge
  std::vector<std::uint32_t> first;       // [edges + 1] into half_edges
  std::size_t edge_count() const { return first.size() - 1; }
  std::span<const std::uint32_t> edge(std::size_t e) const {
    return std::span(half_edges).subspan(first[e], first[e + 1] - first[e]);
  }
};

inline std::uint32_t next_corner(std::uint32_t corner) { return corner % 3 == 2 ? corner - 2 : corner + 1; }
inline std::uint32_t previous_corner(std::uint32_t corner) {
  return corner % 3 == 0 ? corner + 2 : corner - 1;
}

/// Where the corners of a triangle are, which indexes the mesh's wedges.
inline std::array<Vec3d, 3> corner_points(const Mesh& mesh, const Triangle& t) {
  const auto at = [&](std::size_t k) { return to_double(mesh.positions[mesh.wedge_position[t[k]]]); };
  return {at(0), at(1), at(2)};
}

/// Of all triangles, which index the mesh's wedges.
double surface_area(const Mesh& mesh, const std::vector<Triangle>& triangles);

/// Per position the area-weighted sum of its triangles' normals, unit length.
std::vector<Vec3f> position_normals(const Mesh& mesh);

/// All corners of triangles, which must outlive them: 3 t + k is corner k of triangle t.
inline std::span<const std::uint32_t> corners_of(std::span<const Triangle> triangles) {
  return {reinterpret_cast<const std::uint32_t*>(triangles.data()), 3 * triangles.size()};
}

/// `corner_position`: three position indices (< position_count) per triangle, all three different. O(n log
/// n).
EdgeTable group_edges(std::span<const std::uint32_t> corner_position, std::size_t position_count);

/// Union-find whose sets are named by their lowest member, so that names depend on the sets alone.
class DisjointSets {
 public:
  explicit DisjointSets(std::size_t count);
  std::uint32_t find(std::uint32_t a);
  void join(std::uint32_t a, std::uint32_t b);

 private:
  std::vector<std::uint32_t> parent_;
};

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

/// At positions that weld_rounded() has joined (`exact`: the weld before it), joins wedges whose attributes
/// differ by what rounding makes of them, too, so that such a border is no seam: normals and tangents by at
/// most 1/64, colours by 1/128, texture coordinates by 2^-12. Greedily by index, each with the lowest one
/// kept; changes `wedge_weld`. O(n log n).
void weld_rounded_wedges(const Mesh& mesh, const std::vector<std::uint32_t>& exact,
                         const std::vector<std::uint32_t>& position_weld,
                         std::vector<std::uint32_t>& wedge_weld);

/// The box of every connected component, by the components' numbers. `component`: per position.
inline std::vector<Box3f> component_boxes(const std::vector<std::uint32_t>& component,
                                          const std::vector<Vec3f>& positions) {
  std::vector<Box3f> boxes;
  for (std::size_t p = 0; p < component.size(); ++p) {
    if (component[p] >= boxes.size()) boxes.resize(component[p] + 1);
    boxes[component[p]].extend(positions[p]);
  }
  return boxes;
}

/// Charts: triangles that share a wedge lie in one.
std::size_t count_charts(const Mesh& mesh);

}  // namespace texmesh
