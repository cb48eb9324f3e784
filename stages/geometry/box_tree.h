#pragma once
// Binary trees of boxes around things in space: triangles, segments.
#include <array>
#include <vector>

#include "format/base/vec.h"

namespace texmesh {

struct BoxNode {
  Box3d box;
  std::uint32_t first = 0, count = 0;  // things of a leaf; count 0: children at index + 1 and `first`
};

/// Square of the distance to the box; 0 inside.
inline double box_distance2(const Box3d& box, Vec3d p) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double d = std::max({box.min[k] - p[k], p[k] - box.max[k], 0.0});
    sum += d * d;
  }
  return sum;
}

/// Goes from the root down to boxes of which meets(box) holds then, on the way first where rank(box) is less,
/// and calls leaf(node) for what stands at the end.
template <class Meets, class Rank, class Leaf>
void walk_boxes(const std::vector<BoxNode>& nodes, const Meets& meets, const Rank& rank, const Leaf& leaf) {
  // Halving 2^32 things needs no more than 32 levels, each leaving one node behind.
  std::array<std::uint32_t, 40> stack{};
  std::size_t depth = 1;
  while (depth > 0) {
    const std::uint32_t at = stack[--depth];
    const BoxNode& n = nodes[at];
    if (!meets(n.box)) continue;
    if (n.count > 0) {
      leaf(n);
      continue;
    }
    std::uint32_t nearer = at + 1, farther = n.first;
    if (rank(nodes[farther].box) < rank(nodes[nearer].box)) std::swap(nearer, farther);
    stack[depth++] = farther;
    stack[depth++] = nearer;
  }
}

}  // namespace texmesh
