#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "stages/geometry/box_distance.h"
#include "stages/geometry/triangle_tree.h"

namespace texmesh {
namespace {

bool faces(const std::array<Vec3d, 3>& c, const TriangleTree::Facing& facing) {
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  return dot(n, facing.direction) > facing.least_cosine * length(n);
}

}  // namespace

/// A line, and the least crossing that has been found of it.
struct TriangleTree::LineSearch {
  Vec3d origin, direction;
  const Facing& facing;
  double best = 0;  // |t|
  std::optional<Nearest> found;

  void try_triangle(const std::array<Vec3d, 3>& c, std::uint32_t triangle) {
    const Vec3d u = c[1] - c[0], v = c[2] - c[0], h = cross(direction, v);
    const double det = dot(u, h), sign = det < 0 ? -1 : 1, size = det * sign;
    if (!(size > 0)) return;
    const Vec3d s = origin - c[0];
    const double along_u = dot(s, h) * sign;
    if (!(along_u >= 0 && along_u <= size)) return;
    const Vec3d q = cross(s, u);
    const double along_v = dot(direction, q) * sign;
    if (!(along_v >= 0)) return;
    const double a = along_u / size, b = along_v / size;
    if (!(a + b <= 1)) return;
    const double t = std::fabs(dot(v, q) / det);
    if (!(t <= best) || (found && t == best && triangle >= found->triangle) || !faces(c, facing)) return;
    best = t;
    found = {triangle, {1 - a - b, a, b}};
  }
};

std::optional<TriangleTree::Nearest> TriangleTree::crossing(Vec3d origin, Vec3d direction, double reach,
                                                            const Facing& facing,
                                                            std::optional<std::uint32_t> guess) const {
  LineSearch line{origin, direction, facing, reach, std::nullopt};
  if (guess && *guess < place_.size()) line.try_triangle(corners_[place_[*guess]], *guess);
  const QuadLine slabs(origin, direction, reach, largest_);
  struct Ahead {
    float at;
    std::uint32_t quad;
  };
  std::array<Ahead, 64> stack{};  // three more for every two levels of at most 32
  std::size_t depth = 0;
  stack[depth++] = {0, 0};
  while (depth > 0) {
    const Ahead next = stack[--depth];
    if (next.at > line.best) continue;
    const BoxQuad& quad = quads_[next.quad];
    BoxQuad::Lanes at{};
    unsigned met = slabs.meets(quad, line.best, at);
    const std::size_t before = depth;
    for (; met != 0; met &= met - 1) {
      const auto i = static_cast<std::size_t>(std::countr_zero(met));
      if (quad.count[i] == 0) {
        std::size_t to = depth++;
        for (; to > before && stack[to - 1].at < at[i]; --to) stack[to] = stack[to - 1];
        stack[to] = {at[i], quad.first[i]};
      } else if (at[i] <= line.best) {
        for (std::uint32_t t = quad.first[i]; t < quad.first[i] + quad.count[i]; ++t)
          line.try_triangle(corners_[t], order_[t]);
      }
    }
  }
  return line.found;
}

std::optional<TriangleTree::Nearest> TriangleTree::nearest_facing(Vec3d p, const Facing& facing) const {
  std::optional<Nearest> best;
  double distance2 = std::numeric_limits<double>::infinity();
  struct Ahead {
    double distance2;
    std::uint32_t node;
  };
  std::array<Ahead, 40> stack{};
  std::size_t depth = 1;
  while (depth > 0) {
    const Ahead at = stack[--depth];
    if (at.distance2 > distance2) continue;
    const Node& n = nodes_[at.node];
    for (std::uint32_t i = n.first; i < n.first + n.count; ++i) {
      const OnTriangle on = closest_on_triangle(corners_[i], p);
      if (!(on.distance2 < distance2 || (on.distance2 == distance2 && best && order_[i] < best->triangle)) ||
          !faces(corners_[i], facing))
        continue;
      distance2 = on.distance2;
      best = {order_[i], on.weight};
    }
    if (n.count > 0) continue;
    Ahead nearer{box_distance2(nodes_[at.node + 1].box, p), at.node + 1},
        farther{box_distance2(nodes_[n.first].box, p), n.first};
    if (farther.distance2 < nearer.distance2) std::swap(nearer, farther);
    stack[depth++] = farther;
    stack[depth++] = nearer;
  }
  return best;
}

}  // namespace texmesh
