#include "stages/skeletonization/segment_tree.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace texmesh {
namespace {

constexpr std::uint32_t kLeaf = 4;

double square(double x) { return x * x; }

double segment_distance_squared(Vec3d a, Vec3d b, Vec3d p) {
  const Vec3d along = b - a;
  const double l = dot(along, along), t = l > 0 ? std::clamp(dot(p - a, along) / l, 0.0, 1.0) : 0;
  const Vec3d d = p - (a + along * t);
  return dot(d, d);
}

}  // namespace

SegmentTree::SegmentTree(std::span<const Vec3d> nodes,
                         std::span<const std::array<std::uint32_t, 2>> segments) {
  for (const auto& s : segments) segments_.push_back({nodes[s[0]], nodes[s[1]]});
  build(0, static_cast<std::uint32_t>(segments_.size()));
}

void SegmentTree::build(std::uint32_t first, std::uint32_t count) {
  Box3d box;
  for (std::uint32_t i = first; i < first + count; ++i)
    for (const Vec3d& p : {segments_[i].a, segments_[i].b}) box.extend(p);
  const std::size_t node = nodes_.size();
  nodes_.push_back({box, first, count});
  if (count <= kLeaf) return;
  const int axis = box.longest_axis();
  const auto begin = segments_.begin() + first, end = begin + count;
  std::stable_sort(begin, end, [axis](const Segment& s, const Segment& t) {
    return s.a[axis] + s.b[axis] < t.a[axis] + t.b[axis];
  });
  build(first, count / 2);
  nodes_[node].first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[node].count = 0;
  build(first + count / 2, count - count / 2);
}

double SegmentTree::distance(Vec3d p) const {
  const auto box_distance = [&](const Box3d& b) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) sum += square(std::max({b.min[k] - p[k], 0.0, p[k] - b.max[k]}));
    return sum;
  };
  double best = std::numeric_limits<double>::infinity();
  // Halving 2^32 segments needs no more than 32 levels, each leaving one node behind.
  std::array<std::uint32_t, 40> stack{};
  std::size_t depth = 1;
  while (depth > 0) {
    const std::uint32_t at = stack[--depth];
    const Node& n = nodes_[at];
    if (box_distance(n.box) >= best) continue;
    if (n.count > 0) {
      for (std::uint32_t i = n.first; i < n.first + n.count; ++i)
        best = std::min(best, segment_distance_squared(segments_[i].a, segments_[i].b, p));
      continue;
    }
    std::uint32_t nearer = at + 1, farther = n.first;
    if (box_distance(nodes_[farther].box) < box_distance(nodes_[nearer].box)) std::swap(nearer, farther);
    stack[depth++] = farther;
    stack[depth++] = nearer;
  }
  return std::sqrt(best);
}

}  // namespace texmesh
