#include "stages/geometry/distance.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "stages/geometry/morton.h"

namespace texmesh {
namespace {

constexpr std::uint32_t kLeafTriangles = 4;

/// Sorts by code, keeping the order of equal ones: six passes over the items take a tenth of what comparing
/// takes.
void sort_by_code(std::vector<CurvedTriangle>& items) {
  constexpr unsigned kDigit = 11;
  std::vector<CurvedTriangle> other(items.size());
  for (unsigned shift = 0; shift < 63; shift += kDigit) {
    std::vector<std::uint32_t> at((1u << kDigit) + 1, 0);
    auto digit = [shift](const CurvedTriangle& c) { return (c.code >> shift) & ((1u << kDigit) - 1); };
    for (const CurvedTriangle& c : items) ++at[digit(c) + 1];
    for (std::size_t d = 1; d < at.size(); ++d) at[d] += at[d - 1];
    for (const CurvedTriangle& c : items) other[at[digit(c)]++] = c;
    items.swap(other);
  }
}

/// The triangles in the order of a space-filling curve through their centres.
template <class Centre>
std::vector<CurvedTriangle> along_curve(std::size_t count, Centre&& centre) {
  std::vector<CurvedTriangle> order(count);
  if (count == 0) return order;
  Box3f centres;
  for (std::size_t t = 0; t < count; ++t) centres.extend(centre(t));
  const Box3d box = to_double(centres);
  const double side = box.longest_side();
  const double scale = side > 0 ? 2097151.0 / side : 0;
  for (std::size_t t = 0; t < count; ++t) {
    const Vec3d p = (to_double(centre(t)) - box.min) * scale;
    order[t] = {morton_code(static_cast<std::uint32_t>(p.x), static_cast<std::uint32_t>(p.y),
                            static_cast<std::uint32_t>(p.z)),
                static_cast<std::uint32_t>(t)};
  }
  sort_by_code(order);
  return order;
}

double float_box_distance2(Vec3d p, const Box3f& box) {
  double sum = 0;
  for (int k = 0; k < 3; ++k) {
    const double below = static_cast<double>(box.min[k]) - p[k];
    const double above = p[k] - static_cast<double>(box.max[k]);
    const double d = std::max(std::max(below, above), 0.0);
    sum += d * d;
  }
  return sum;
}

/// Squared distance of the origin to the segment a, b.
double segment_distance2(Vec3d a, Vec3d b) {
  const Vec3d d = b - a;
  const double square = dot(d, d);
  const double t = square > 0 ? std::clamp(-dot(a, d) / square, 0.0, 1.0) : 0;
  const Vec3d q = a + d * t;
  return dot(q, q);
}

/// Squared distance of the origin to a triangle, degenerate ones included.
double triangle_distance2(Vec3d a, Vec3d b, Vec3d c) {
  const Vec3d n = cross(b - a, c - a);
  const double square = dot(n, n);
  if (square > 0 && dot(cross(a, b), n) >= 0 && dot(cross(b, c), n) >= 0 && dot(cross(c, a), n) >= 0) {
    const double d = dot(a, n);
    return d * d / square;
  }
  return std::min({segment_distance2(a, b), segment_distance2(b, c), segment_distance2(c, a)});
}

}  // namespace

SurfaceDistance::SurfaceDistance(const std::vector<Vec3f>& positions,
                                 const std::vector<std::uint32_t>& wedge_position,
                                 const std::vector<Triangle>& triangles) {
  const std::size_t n = triangles.size();
  auto corner = [&](std::size_t t, std::size_t k) { return positions[wedge_position[triangles[t][k]]]; };
  const std::vector<CurvedTriangle> order = along_curve(
      n, [&](std::size_t t) { return (corner(t, 0) + corner(t, 1) + corner(t, 2)) * (1.0f / 3); });
  nodes_.reserve(n);
  nodes_.emplace_back();
  split(0, 0, static_cast<std::uint32_t>(n), order);
  corners_.resize(3 * n);
  leaf_of_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    leaf_of_[order[i].triangle] = static_cast<std::uint32_t>(i);
    for (std::size_t k = 0; k < 3; ++k) corners_[3 * i + k] = corner(order[i].triangle, k);
  }
  // Children stand behind their parents, so one pass from the back fits all boxes.
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    Node& node = nodes_[i];
    if (node.count == 0) {
      node.box = nodes_[node.first].box;
      node.box.extend(nodes_[node.first + 1].box);
      continue;
    }
    for (std::size_t c = 3 * node.first; c < 3 * (node.first + node.count); ++c) node.box.extend(corners_[c]);
  }
}

void SurfaceDistance::split(std::uint32_t node, std::uint32_t begin, std::uint32_t end,
                            const std::vector<CurvedTriangle>& order) {
  if (end - begin <= kLeafTriangles) {
    nodes_[node].first = begin;
    nodes_[node].count = end - begin;
    return;
  }
  // Where the highest bit changes the curve leaves one half of a cube for the other.
  std::uint32_t middle = begin + (end - begin) / 2;
  if (const std::uint64_t differ = order[begin].code ^ order[end - 1].code; differ != 0) {
    const std::uint64_t bit = std::bit_floor(differ);
    const auto at = std::partition_point(order.begin() + begin, order.begin() + end,
                                         [bit](const CurvedTriangle& c) { return (c.code & bit) == 0; });
    middle = static_cast<std::uint32_t>(at - order.begin());
  }
  const auto child = static_cast<std::uint32_t>(nodes_.size());
  nodes_.resize(nodes_.size() + 2);
  nodes_[node].first = child;
  split(child, begin, middle, order);
  split(child + 1, middle, end, order);
}

double SurfaceDistance::operator()(Vec3d p, double enough) const {
  std::uint32_t leaf = 0;
  return search(p, enough, std::numeric_limits<double>::infinity(), leaf);
}

double SurfaceDistance::operator()(Vec3d p, Hint& hint) const {
  double best = std::numeric_limits<double>::infinity();
  if (hint.leaf != Hint{}.leaf) {
    const Vec3f* c = &corners_[3 * std::size_t{hint.leaf}];
    best = triangle_distance2(to_double(c[0]) - p, to_double(c[1]) - p, to_double(c[2]) - p);
  }
  return search(p, 0, best, hint.leaf);
}

/// `best` is the square of an upper bound that triangle `leaf` gives.
double SurfaceDistance::search(Vec3d p, double enough, double best, std::uint32_t& leaf) const {
  struct Open {
    std::uint32_t node;
    double distance2;
  };
  Open stack[128];  // 63 bits of the curve, and halves of what shares a cell
  int depth = 0;
  const double enough2 = enough * enough;
  stack[depth++] = {0, float_box_distance2(p, nodes_[0].box)};
  while (depth > 0) {
    const Open open = stack[--depth];
    if (open.distance2 >= best) continue;
    const Node& node = nodes_[open.node];
    if (node.count > 0) {
      for (std::uint32_t t = node.first; t < node.first + node.count; ++t) {
        const double d =
            triangle_distance2(to_double(corners_[3 * t]) - p, to_double(corners_[3 * t + 1]) - p,
                               to_double(corners_[3 * t + 2]) - p);
        if (d < best) best = d, leaf = t;
      }
      if (best <= enough2) break;
      continue;
    }
    Open near{node.first, float_box_distance2(p, nodes_[node.first].box)};
    Open far{node.first + 1, float_box_distance2(p, nodes_[node.first + 1].box)};
    if (far.distance2 < near.distance2) std::swap(near, far);
    if (far.distance2 < best) stack[depth++] = far;
    if (near.distance2 < best) stack[depth++] = near;
  }
  return std::sqrt(best);
}

std::vector<SurfaceSample> sample_surface(const std::vector<Vec3f>& positions,
                                          const std::vector<std::uint32_t>& wedge_position,
                                          const std::vector<Triangle>& triangles, std::size_t count) {
  std::vector<double> until(triangles.size());
  double total = 0;
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    const Vec3d a = to_double(positions[wedge_position[triangles[t][0]]]);
    const Vec3d b = to_double(positions[wedge_position[triangles[t][1]]]);
    const Vec3d c = to_double(positions[wedge_position[triangles[t][2]]]);
    total += length(cross(b - a, c - a));
    until[t] = total;
  }
  std::vector<SurfaceSample> samples;
  if (!(total > 0)) return samples;
  samples.reserve(count);
  std::size_t t = 0;
  double x = 0.5, y = 0.5;  // the R2 sequence: multiples of the plastic number's powers modulo 1
  for (std::size_t i = 0; i < count; ++i) {
    const double at = total * ((static_cast<double>(i) + 0.5) / static_cast<double>(count));
    while (t + 1 < triangles.size() && until[t] < at) ++t;
    x += 0.7548776662466927, y += 0.5698402909980532;
    x -= std::floor(x), y -= std::floor(y);
    const double r = std::sqrt(x);
    SurfaceSample s;
    s.triangle = static_cast<std::uint32_t>(t);
    s.weight[0] = static_cast<float>(1 - r);
    s.weight[1] = static_cast<float>(r * (1 - y));
    s.weight[2] = static_cast<float>(r * y);
    samples.push_back(s);
  }
  return samples;
}

}  // namespace texmesh
