#include "stages/geometry/distance.h"

#include <bit>

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
std::vector<CurvedTriangle> along_curve(std::size_t count, auto&& centre) {
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

/// Where the highest bit changes the curve leaves one half of a cube for the other.
std::uint32_t middle_of(std::uint32_t begin, std::uint32_t end, const std::vector<CurvedTriangle>& order) {
  const std::uint64_t differ = order[begin].code ^ order[end - 1].code;
  if (differ == 0) return begin + (end - begin) / 2;
  const std::uint64_t bit = std::bit_floor(differ);
  const auto at = std::partition_point(order.begin() + begin, order.begin() + end,
                                       [bit](const CurvedTriangle& c) { return (c.code & bit) == 0; });
  return static_cast<std::uint32_t>(at - order.begin());
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
  constexpr double kNeedle =
      1e-8;  // square of height over edge: below it rounding says which edge is crossed
  const Vec3d u = b - a, v = c - a, n = cross(u, v);
  const double square = dot(n, n), edge = std::max(dot(u, u), dot(v, v));
  const bool out_ab = dot(cross(a, b), n) < 0, out_bc = dot(cross(b, c), n) < 0,
             out_ca = dot(cross(c, a), n) < 0;
  if (square > 0 && !out_ab && !out_bc && !out_ca) {
    const double d = dot(a, n);
    return d * d / square;
  }
  // The closest point is on an edge that the origin is beyond.
  const bool any = !(square > kNeedle * edge * edge);
  double best = std::numeric_limits<double>::infinity();
  if (any || out_ab) best = segment_distance2(a, b);
  if (any || out_bc) best = std::min(best, segment_distance2(b, c));
  if (any || out_ca) best = std::min(best, segment_distance2(c, a));
  return best;
}

constexpr int kMostCorners = 4;

}  // namespace

SurfaceDistance::SurfaceDistance(const std::vector<Vec3f>& positions,
                                 const std::vector<std::uint32_t>& wedge_position,
                                 const std::vector<Triangle>& triangles) {
  const std::size_t n = triangles.size();
  auto corner = [&](std::size_t t, std::size_t k) { return positions[wedge_position[triangles[t][k]]]; };
  const std::vector<CurvedTriangle> order = along_curve(
      n, [&](std::size_t t) { return (corner(t, 0) + corner(t, 1) + corner(t, 2)) * (1.0f / 3); });
  Box3f box;
  corners_.resize(3 * n);
  leaf_of_.resize(n);
  for (std::size_t i = 0; i < n; ++i) {
    leaf_of_[order[i].triangle] = static_cast<std::uint32_t>(i);
    for (std::size_t k = 0; k < 3; ++k) box.extend(corners_[3 * i + k] = corner(order[i].triangle, k));
  }
  frame_.centre = to_double(box).centre();
  if (const double side = to_double(box).longest_side(); side > 0) frame_.scale = 1 / side;
  nodes_.reserve(n / 4 + 1);
  nodes_.emplace_back();
  split(0, 0, static_cast<std::uint32_t>(n), order);
  fit_boxes();
}

void SurfaceDistance::split(std::uint32_t node, std::uint32_t begin, std::uint32_t end,
                            const std::vector<CurvedTriangle>& order) {
  std::array<std::uint32_t, 5> at{begin, end};
  std::size_t parts = 1;
  for (int round = 0; round < 2; ++round) {
    std::array<std::uint32_t, 5> next{begin};
    std::size_t count = 0;
    for (std::size_t i = 0; i < parts; ++i) {
      if (at[i + 1] - at[i] > kLeafTriangles) next[++count] = middle_of(at[i], at[i + 1], order);
      next[++count] = at[i + 1];
    }
    at = next, parts = count;
  }
  for (std::size_t i = 0; i < 4; ++i) {
    const bool used = i < parts, leaf = used && at[i + 1] - at[i] <= kLeafTriangles;
    nodes_[node].first[i] = used ? at[i] : 0;
    nodes_[node].count[i] = leaf ? at[i + 1] - at[i] : 0;
    if (!used || leaf) continue;
    const auto child = static_cast<std::uint32_t>(nodes_.size());
    nodes_.emplace_back();
    nodes_[node].first[i] = child;
    split(child, at[i], at[i + 1], order);
  }
}

/// Children stand behind their parents, so one pass from the back fits all boxes.
void SurfaceDistance::fit_boxes() {
  constexpr float kSlack = 0x1p-22f;  // more than what rounding moves places within the frame by
  constexpr float kNowhere = std::numeric_limits<float>::max();
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    Node& node = nodes_[n];
    for (std::size_t i = 0; i < 4; ++i) {
      Vec3f lo{kNowhere, kNowhere, kNowhere}, hi = lo * -1;
      const auto extend = [&](float low, float high, int k) {
        lo[k] = std::min(lo[k], low), hi[k] = std::max(hi[k], high);
      };
      if (node.count[i] > 0) {
        for (std::size_t c = 3 * node.first[i]; c < 3 * (node.first[i] + node.count[i]); ++c) {
          const Vec3f p = to_float((to_double(corners_[c]) - frame_.centre) * frame_.scale);
          for (int k = 0; k < 3; ++k) extend(p[k] - kSlack, p[k] + kSlack, k);
        }
      } else if (node.first[i] > n) {
        const Node& child = nodes_[node.first[i]];
        for (std::size_t j = 0; j < 4; ++j)
          for (int k = 0; k < 3; ++k) extend(child.min[k][j], child.max[k][j], k);
      }
      for (int k = 0; k < 3; ++k) node.min[k][i] = lo[k], node.max[k][i] = hi[k];
    }
  }
}

/// Squares of lower bounds, in the frame's unit; infinite where there is no child.
SurfaceDistance::Lanes SurfaceDistance::box_distances2(const Lanes (&p)[3], const Node& node) const {
  constexpr float kOfRounding = 1e-6f;
  Lanes sum{};
  for (int k = 0; k < 3; ++k) {
    const Lanes below = node.min[k] - p[k], above = p[k] - node.max[k];
    Lanes d = below > above ? below : above;
    d = d > 0.0f ? d : Lanes{};
    sum += d * d;
  }
  return sum * (1 - kOfRounding);
}

double SurfaceDistance::operator()(Vec3d p, double enough) const {
  std::uint32_t leaf = 0;
  return search(p, enough, std::numeric_limits<double>::infinity(), leaf);
}

double SurfaceDistance::operator()(Vec3d p, Hint& hint) const {
  double best = std::numeric_limits<double>::infinity();
  if (hint.leaf != kNoIndex) best = leaf_distance2(hint.leaf, p);
  return search(p, 0, best, hint.leaf);
}

double SurfaceDistance::leaf_distance2(std::uint32_t leaf, Vec3d p) const {
  const Vec3f* c = &corners_[3 * std::size_t{leaf}];
  return triangle_distance2(to_double(c[0]) - p, to_double(c[1]) - p, to_double(c[2]) - p);
}

SurfaceDistance::Hint SurfaceDistance::nearer(Hint a, Hint b, Vec3d p) const {
  return b.leaf != kNoIndex && leaf_distance2(b.leaf, p) < leaf_distance2(a.leaf, p) ? b : a;
}

double SurfaceDistance::distance2_to(std::uint32_t triangle, Vec3d p) const {
  return leaf_distance2(leaf_of_[triangle], p);
}

Vec3f SurfaceDistance::centre_of(std::uint32_t triangle) const {
  const Vec3f* c = &corners_[3 * std::size_t{leaf_of_[triangle]}];
  return (c[0] + c[1] + c[2]) * (1.0f / 3);
}

/// `best` is the square of an upper bound that triangle `leaf` gives.
double SurfaceDistance::search(Vec3d p, double enough, double best, std::uint32_t& leaf) const {
  struct Open {
    std::uint32_t first, count;
    float distance2;
  };
  // 63 bits of the curve and halves of what shares a cell, two to a node, of which three children wait.
  Open stack[3 * 48 + 4];
  int depth = 0;
  const double enough2 = enough * enough, square = frame_.scale * frame_.scale;
  constexpr double kFar = 1e18;  // its square is a float
  const Vec3d q = (p - frame_.centre) * frame_.scale;
  Lanes place[3];
  for (int k = 0; k < 3; ++k) place[k] = Lanes{} + static_cast<float>(std::clamp(q[k], -kFar, kFar));
  stack[depth++] = {0, 0, 0};
  while (depth > 0) {
    const Open open = stack[--depth];
    if (static_cast<double>(open.distance2) >= best * square) continue;
    if (open.count > 0) {
      for (std::uint32_t t = open.first; t < open.first + open.count; ++t)
        if (const double d = leaf_distance2(t, p); d < best) best = d, leaf = t;
      if (best <= enough2) break;
      continue;
    }
    const Node& node = nodes_[open.first];
    const Lanes distance2 = box_distances2(place, node);
    const int bottom = depth;
    for (int i = 0; i < 4; ++i) {
      if (!(static_cast<double>(distance2[i]) < best * square)) continue;
      int at = depth++;  // farthest first
      for (; at > bottom && stack[at - 1].distance2 < distance2[i]; --at) stack[at] = stack[at - 1];
      stack[at] = {node.first[i], node.count[i], distance2[i]};
    }
  }
  return std::sqrt(best);
}

std::size_t enough_samples(std::size_t triangles, std::size_t most) {
  constexpr std::size_t kLeast = 250, kTrianglesOfOneEach = 4;
  return std::min(most, std::max(kLeast, triangles / kTrianglesOfOneEach));
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

std::vector<std::uint32_t> survivors(std::size_t positions, std::span<const Collapse> collapses,
                                     std::size_t count) {
  std::vector<std::uint32_t> survivor(positions);
  for (std::size_t p = 0; p < positions; ++p) survivor[p] = static_cast<std::uint32_t>(p);
  // Backwards, so that a chain's end is known before the links that lead to it.
  for (std::size_t c = count; c-- > 0;) survivor[collapses[c].from] = survivor[collapses[c].to];
  return survivor;
}

ScaleWalk::ScaleWalk(const Mesh& mesh, const std::vector<Triangle>& triangles,
                     std::span<const std::uint32_t> survivor, const SurfaceDistance& surface)
    : positions_(mesh.positions),
      survivor_(survivor),
      surface_(surface),
      spokes_(mesh.positions.size(), triangles, [&](std::uint32_t w) { return mesh.wedge_position[w]; }) {}

std::uint32_t ScaleWalk::nearest_corner(std::uint32_t from, Vec3d point) const {
  const auto distance2 = [&](std::uint32_t p) {
    const Vec3d d = to_double(positions_[p]) - point;
    return dot(d, d);
  };
  double best = distance2(from);
  for (int walk = 0; walk < kMostCorners; ++walk) {
    std::uint32_t next = from;
    for (const Spokes::Spoke& spoke : spokes_.at(from))
      if (const double d = distance2(spoke.next); d < best) best = d, next = spoke.next;
    if (next == from) break;
    from = next;
  }
  return from;
}

ScaleWalk::Guess ScaleWalk::from(std::uint32_t position, Vec3d point) const {
  Guess best{std::numeric_limits<double>::infinity(), kNoIndex, {}};
  const std::uint32_t at = nearest_corner(survivor_[position], point);
  for (const Spokes::Spoke& spoke : spokes_.at(at)) {
    if (!(best.distance2 > 0)) break;
    if (const double d = surface_.distance2_to(spoke.triangle, point); d < best.distance2)
      best.distance2 = d, best.triangle = spoke.triangle;
  }
  if (best.triangle != kNoIndex) best.hint = surface_.hint_of(best.triangle);
  return best;
}

ScaleWalk::Guess ScaleWalk::quick_from(std::uint32_t position, Vec3d point) const {
  constexpr double kFar = std::numeric_limits<double>::infinity();
  double nearest = kFar;
  std::uint32_t triangle = kNoIndex;
  for (const Spokes::Spoke& spoke : spokes_.at(nearest_corner(survivor_[position], point))) {
    const Vec3d way = to_double(surface_.centre_of(spoke.triangle)) - point;
    if (const double d = dot(way, way); d < nearest) nearest = d, triangle = spoke.triangle;
  }
  if (triangle == kNoIndex) return {kFar, kNoIndex, {}};
  return {surface_.distance2_to(triangle, point), triangle, surface_.hint_of(triangle)};
}

}  // namespace texmesh
