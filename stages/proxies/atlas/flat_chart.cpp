#include "stages/proxies/atlas/flat_chart.h"

#include <algorithm>
#include <cstddef>
#include <limits>
#include <utility>

#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

struct BorderSegment {
  Vec2d from, to;
  std::uint32_t from_vertex = 0, to_vertex = 0;
  double left() const { return std::min(from.x, to.x); }
  double right() const { return std::max(from.x, to.x); }
  bool shares_end(const BorderSegment& o) const {
    return from_vertex == o.from_vertex || from_vertex == o.to_vertex || to_vertex == o.from_vertex ||
           to_vertex == o.to_vertex;
  }
};

bool ranges_meet(double a, double b, double c, double d) {
  return std::max(a, b) >= std::min(c, d) && std::max(c, d) >= std::min(a, b);
}

bool segments_meet(const BorderSegment& s, const BorderSegment& t) {
  if (!ranges_meet(s.from.y, s.to.y, t.from.y, t.to.y)) return false;
  const auto side = [](const BorderSegment& of, Vec2d p) { return cross(of.to - of.from, p - of.from); };
  return side(s, t.from) * side(s, t.to) <= 0 && side(t, s.from) * side(t, s.to) <= 0;
}

std::vector<Vec2d> convex_hull(std::vector<Vec2d> points) {
  std::sort(points.begin(), points.end(),
            [](Vec2d a, Vec2d b) { return a.x != b.x ? a.x < b.x : a.y < b.y; });
  points.erase(std::unique(points.begin(), points.end()), points.end());
  if (points.size() < 3) return points;
  std::vector<Vec2d> hull;
  const auto add = [&](Vec2d p, std::size_t least) {
    while (hull.size() >= least + 2 && cross(hull.back() - hull[hull.size() - 2], p - hull.back()) <= 0)
      hull.pop_back();
    hull.push_back(p);
  };
  for (const Vec2d p : points) add(p, 0);
  const std::size_t lower = hull.size() - 1;
  for (std::size_t i = points.size() - 1; i-- > 0;) add(points[i], lower);
  hull.pop_back();
  return hull;
}

}  // namespace

PlaneAxes::PlaneAxes(Vec3d n) {
  const Vec3d size{std::fabs(n.x), std::fabs(n.y), std::fabs(n.z)};
  const int least = size.x <= size.y && size.x <= size.z ? 0 : size.y <= size.z ? 1 : 2;
  Vec3d helper;
  helper[least] = 1;
  x = normalized(cross(helper, n));
  y = cross(n, x);
}

OwnPlane::OwnPlane(const std::array<Vec3d, 3>& p) {
  const Vec3d along = p[1] - p[0], other = p[2] - p[0];
  base = length(along);
  if (!(base > 0)) return;
  apex = {dot(other, along) / base, length(cross(along, other)) / base};
}

FlatStretch flat_stretch(const OwnPlane& own, const Vec2d* p) {
  const Vec2d s = (p[1] - p[0]) * (1 / own.base);
  const Vec2d t = (p[2] - p[0] - s * own.apex.x) * (1 / own.apex.y);
  const double ss = dot(s, s), tt = dot(t, t), st = dot(s, t);
  const double root = std::sqrt((ss - tt) * (ss - tt) + 4 * st * st), determinant = cross(s, t);
  const double largest2 = (ss + tt + root) / 2;
  // The difference (ss + tt - root) / 2 would lose its digits.
  return {largest2, largest2 > 0 ? determinant * determinant / largest2 : 0, determinant * own.area()};
}

bool border_is_simple(std::span<const std::uint32_t> half_edges, const std::vector<std::uint32_t>& vertices,
                      const std::vector<Vec2d>& places) {
  std::vector<BorderSegment> segments;
  segments.reserve(half_edges.size());
  for (const std::uint32_t h : half_edges) {
    const std::uint32_t next = next_corner(h);
    segments.push_back({places[h], places[next], vertices[h], vertices[next]});
  }
  std::sort(segments.begin(), segments.end(), [](const BorderSegment& a, const BorderSegment& b) {
    return a.left() != b.left() ? a.left() < b.left() : a.from_vertex < b.from_vertex;
  });
  for (std::size_t i = 0; i < segments.size(); ++i)
    for (std::size_t j = i + 1; j < segments.size() && segments[j].left() <= segments[i].right(); ++j)
      if (!segments[i].shares_end(segments[j]) && segments_meet(segments[i], segments[j])) return false;
  return true;
}

Vec2d smallest_box_side(std::vector<Vec2d> points) {
  const std::vector<Vec2d> hull = convex_hull(std::move(points));
  double least = std::numeric_limits<double>::infinity();
  Vec2d best{1, 0};
  for (std::size_t i = 0; i < hull.size(); ++i) {
    const Vec2d edge = hull[(i + 1) % hull.size()] - hull[i];
    const double size = std::sqrt(dot(edge, edge));
    if (!(size > 0)) continue;
    const Vec2d side = edge * (1 / size);
    double left = 0, right = 0, top = 0;  // the hull lies on one side of its edge
    for (const Vec2d p : hull) {
      const double along = dot(p - hull[i], side);
      left = std::min(left, along);
      right = std::max(right, along);
      top = std::max(top, cross(side, p - hull[i]));
    }
    if (const double area = (right - left) * top; area < least) least = area, best = side;
  }
  return best;
}

}  // namespace texmesh
