#pragma once
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/box.h"
#include "format/base/vec.h"

namespace texmesh {

/// A bounding-volume tree over line segments for closest-distance queries. Segments of no length are points.
class SegmentTree {
 public:
  /// At least one segment; every index below nodes.size().
  SegmentTree(std::span<const Vec3d> nodes, std::span<const std::array<std::uint32_t, 2>> segments);

  /// The distance from p to the closest segment. Safe to call from many threads.
  double distance(Vec3d p) const;

 private:
  struct Segment {
    Vec3d a, b;
  };
  struct Node {
    Box3d box;
    // Of a leaf: its segments. An inner node has count 0 and its children at its index + 1 and at `first`.
    std::uint32_t first, count;
  };
  void build(std::uint32_t first, std::uint32_t count);

  std::vector<Segment> segments_;
  std::vector<Node> nodes_;
};

}  // namespace texmesh
