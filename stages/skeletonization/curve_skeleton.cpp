#include "stages/skeletonization/curve_skeleton.h"

namespace texmesh {
namespace {

/// A node has the poles of a few points, and poles of a wrap's flat faces scatter. The worst R of three
/// cylinders and three tori is off by 0.8 and 2.6 %; with 3 rounds by 1.0 and 2.8 %, with 40 by 1.7 and 2.6
/// %, and where nothing is recentred by 0.5 and 6.7 %.
constexpr int kSmoothingRounds = 16;

std::vector<NodePoles> smoothed(const CurveSkeleton& curve, std::vector<NodePoles> pull) {
  for (int round = 0; round < kSmoothingRounds; ++round) {
    std::vector<NodePoles> next = pull;
    const auto add = [&](std::uint32_t to, std::uint32_t from) {
      next[to].sum = next[to].sum + pull[from].sum;
      next[to].count += pull[from].count;
    };
    for (const auto& [a, b] : curve.segments) add(a, b), add(b, a);
    pull = std::move(next);
  }
  return pull;
}

/// Directions along which nodes must not move; of length 0 where there is none.
std::vector<Vec3d> directions_along(const CurveSkeleton& curve) {
  std::vector<Vec3d> along(curve.nodes.size());
  std::vector<std::uint32_t> degree(curve.nodes.size(), 0);
  for (const auto& [a, b] : curve.segments) {
    const Vec3d way = curve.nodes[b] - curve.nodes[a];
    // Towards the second neighbour and away from the first one.
    along[a] = degree[a]++ == 0 ? way : way - along[a];
    along[b] = degree[b]++ == 0 ? way * -1 : way * -1 - along[b];
  }
  for (std::size_t n = 0; n < along.size(); ++n) {
    const double size = length(along[n]);
    along[n] = degree[n] > 2 || !(size > 0) ? Vec3d{} : along[n] * (1 / size);
  }
  return along;
}

constexpr std::uint32_t kLeaf = 4;

double square(double x) { return x * x; }

double segment_distance_squared(Vec3d a, Vec3d b, Vec3d p) {
  const Vec3d along = b - a;
  const double l = dot(along, along), t = l > 0 ? std::clamp(dot(p - a, along) / l, 0.0, 1.0) : 0;
  const Vec3d d = p - (a + along * t);
  return dot(d, d);
}

}  // namespace

void recentre(CurveSkeleton& curve, std::span<const NodePoles> poles) {
  std::vector<NodePoles> pull(poles.begin(), poles.end());
  for (std::size_t n = 0; n < pull.size(); ++n) pull[n].sum = pull[n].sum - curve.nodes[n] * pull[n].count;
  pull = smoothed(curve, std::move(pull));
  const std::vector<Vec3d> along = directions_along(curve);
  for (std::size_t n = 0; n < pull.size(); ++n) {
    if (!(pull[n].count > 0)) continue;
    const Vec3d move = pull[n].sum * (1 / pull[n].count);
    curve.nodes[n] = curve.nodes[n] + move - along[n] * dot(move, along[n]);
  }
}

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
