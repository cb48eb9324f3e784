#include "stages/geometry/triangle_tree.h"

#include <bit>
#include <numeric>

namespace texmesh {
namespace {

/// The corners of each side, so that cross(second - first, third - first) looks inwards.
constexpr std::size_t kSides[4][3] = {{1, 3, 2}, {0, 2, 3}, {0, 3, 1}, {0, 1, 2}};

/// A triangle clipped by four half-spaces has at most seven corners.
struct Polygon {
  std::array<Vec3d, 8> corner;
  std::size_t count = 0;
};

constexpr std::uint32_t kLeaf = 4;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

double leaving_hit(const std::array<Vec3d, 3>& c, Vec3d origin, Vec3d direction) {
  const Vec3d u = c[1] - c[0], v = c[2] - c[0], h = cross(direction, v);
  const double det = dot(u, h);
  if (!(det < 0)) return kInfinity;  // dot(direction, normal) = -det: only what looks along the ray
  const Vec3d s = origin - c[0];
  const double a = dot(s, h);
  if (!(a <= 0 && a >= det)) return kInfinity;
  const Vec3d q = cross(s, u);
  const double b = dot(direction, q);
  if (!(b <= 0 && a + b >= det)) return kInfinity;
  const double t = dot(v, q) / det;
  return t > 0 ? t : kInfinity;
}

void try_segment(Vec3d p, const std::array<Vec3d, 3>& c, std::size_t i, std::size_t j, OnTriangle& best) {
  const Vec3d along = c[j] - c[i];
  const double l = dot(along, along), t = l > 0 ? std::clamp(dot(p - c[i], along) / l, 0.0, 1.0) : 0;
  const Vec3d d = p - (c[i] + along * t);
  if (dot(d, d) >= best.distance2) return;
  best.distance2 = dot(d, d);
  best.weight = {};
  best.weight[i] = 1 - t, best.weight[j] += t;
}

bool faces(const std::array<Vec3d, 3>& c, const TriangleTree::Facing& facing) {
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  return dot(n, facing.direction) > facing.least_cosine * length(n);
}

}  // namespace

Tetrahedron::Tetrahedron(const std::array<Vec3d, 4>& corners)
    : corners_(corners), box_(bounding_box(corners)) {
  for (std::size_t s = 0; s < 4; ++s) {
    const Vec3d at = corners[kSides[s][0]];
    planes_[s] = {cross(corners[kSides[s][1]] - at, corners[kSides[s][2]] - at), at};
  }
}

bool Tetrahedron::may_meet_box(const Box3d& box) const {
  for (int k = 0; k < 3; ++k)
    if (box.min[k] > box_.max[k] || box.max[k] < box_.min[k]) return false;
  const Vec3d middle = box.centre(), half = (box.max - box.min) * 0.5;
  for (const Plane& s : planes_)
    if (s.height(middle) + std::fabs(s.inwards.x) * half.x + std::fabs(s.inwards.y) * half.y +
            std::fabs(s.inwards.z) * half.z <
        0)
      return false;
  return true;
}

bool Tetrahedron::meets(const std::array<Vec3d, 3>& triangle) const {
  // Most triangles are asked in vain: near a surface cells lie along it, on one side.
  const Vec3d normal = cross(triangle[1] - triangle[0], triangle[2] - triangle[0]);
  int above = 0, below = 0;
  for (const Vec3d& c : corners_) {
    const double h = dot(normal, c - triangle[0]);
    above += h > 0, below += h < 0;
  }
  if (above == 4 || below == 4) return false;
  for (const Plane& s : planes_)
    if (s.height(triangle[0]) < 0 && s.height(triangle[1]) < 0 && s.height(triangle[2]) < 0) return false;
  return clipped(triangle);
}

bool Tetrahedron::clipped(const std::array<Vec3d, 3>& triangle) const {
  Polygon in;
  in.count = 3;
  std::copy(triangle.begin(), triangle.end(), in.corner.begin());
  for (const Plane& s : planes_) {
    std::array<double, 8> height{};
    bool inside = true;
    for (std::size_t i = 0; i < in.count; ++i) {
      height[i] = s.height(in.corner[i]);
      inside = inside && height[i] >= 0;
    }
    if (inside) continue;
    Polygon out;
    for (std::size_t i = 0; i < in.count; ++i) {
      const std::size_t j = i + 1 < in.count ? i + 1 : 0;
      if (height[i] >= 0) out.corner[out.count++] = in.corner[i];
      if ((height[i] < 0) != (height[j] < 0))
        out.corner[out.count++] =
            in.corner[i] + (in.corner[j] - in.corner[i]) * (height[i] / (height[i] - height[j]));
    }
    if (out.count == 0) return false;
    in = out;
  }
  return true;
}

OnTriangle closest_on_triangle(const std::array<Vec3d, 3>& c, Vec3d p) {
  OnTriangle best;
  best.distance2 = kInfinity;
  const Vec3d n = cross(c[1] - c[0], c[2] - c[0]);
  const double square = dot(n, n);
  if (square > 0) {
    std::array<double, 3> w{};
    for (std::size_t k = 0; k < 3; ++k) w[k] = dot(cross(c[(k + 1) % 3] - p, c[(k + 2) % 3] - p), n) / square;
    if (w[0] >= 0 && w[1] >= 0 && w[2] >= 0) {
      const double d = dot(p - c[0], n);
      return {d * d / square, w};
    }
  }
  for (std::size_t k = 0; k < 3; ++k) try_segment(p, c, k, (k + 1) % 3, best);
  return best;
}

TriangleTree::TriangleTree(std::span<const Vec3d> points, std::span<const Triangle> triangles)
    : order_(triangles.size()) {
  std::vector<Vec3d> centres;
  for (const Triangle& t : triangles)
    centres.push_back((points[t[0]] + points[t[1]] + points[t[2]]) * (1.0 / 3));
  std::iota(order_.begin(), order_.end(), 0u);
  corners_.resize(triangles.size());
  nodes_.reserve(triangles.size());
  build(0, static_cast<std::uint32_t>(triangles.size()), centres);
  for (std::size_t i = 0; i < order_.size(); ++i)
    for (std::size_t k = 0; k < 3; ++k) corners_[i][k] = points[triangles[order_[i]][k]];
  place_.resize(order_.size());
  for (std::size_t i = 0; i < order_.size(); ++i) place_[order_[i]] = static_cast<std::uint32_t>(i);
  // Children stand behind their parents, so one pass from the back fits all boxes.
  for (std::size_t n = nodes_.size(); n-- > 0;) {
    BoxNode& node = nodes_[n];
    for (std::uint32_t i = node.first; i < node.first + node.count; ++i)
      for (const Vec3d& p : corners_[i]) node.box.extend(p);
    if (node.count == 0)
      for (const std::size_t child : {n + 1, std::size_t{node.first}}) node.box.extend(nodes_[child].box);
  }
  for (int k = 0; k < 3; ++k)
    largest_ = std::max({largest_, std::fabs(box().min[k]), std::fabs(box().max[k])});
  add_quad(0);
}

/// Of a node's grandchildren, or of children that are leaves, and all that are below; its index.
std::uint32_t TriangleTree::add_quad(std::uint32_t node) {
  std::array<std::uint32_t, BoxQuad::kBoxes> boxes{};
  std::size_t count = 0;
  const auto add_below = [&](std::uint32_t n, auto add) {
    if (nodes_[n].count > 0)
      boxes[count++] = n;
    else
      add(n + 1), add(nodes_[n].first);
  };
  add_below(node, [&](std::uint32_t child) {
    add_below(child, [&](std::uint32_t below) { boxes[count++] = below; });
  });
  const auto index = static_cast<std::uint32_t>(quads_.size());
  quads_.emplace_back();
  for (std::size_t i = 0; i < count; ++i) {
    const BoxNode& n = nodes_[boxes[i]];
    const std::uint32_t first = n.count > 0 ? n.first : add_quad(boxes[i]);
    quads_[index].set(i, n.box, first, n.count);
  }
  return index;
}

void TriangleTree::build(std::uint32_t first, std::uint32_t count, std::vector<Vec3d>& centres) {
  const std::size_t node = nodes_.size();
  nodes_.push_back({{}, first, count});
  if (count <= kLeaf) return;
  Box3d box;
  for (std::uint32_t i = first; i < first + count; ++i) box.extend(centres[order_[i]]);
  const int axis = box.longest_axis();
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](std::uint32_t a, std::uint32_t b) {
    return centres[a][axis] < centres[b][axis] || (centres[a][axis] == centres[b][axis] && a < b);
  });
  build(first, count / 2, centres);
  nodes_[node].first = static_cast<std::uint32_t>(nodes_.size());
  nodes_[node].count = 0;
  build(first + count / 2, count - count / 2, centres);
}

/// Looks at boxes in single precision, a little too large, four rays at once; at triangles as for one ray.
struct TriangleTree::RayBundle {
  using Lanes = float __attribute__((vector_size(16)));
  static constexpr std::size_t kGroups = kRays / 4;
  static constexpr float kSlack = 1e-5f;

  Vec3d origin;
  const Rays& directions;
  float touch;  // boxes that are farther off are not met
  Lanes inverse[3][kGroups], limit[kGroups];
  std::array<double, kRays> best;

  RayBundle(Vec3d from, const Rays& along, double size)
      : origin(from), directions(along), touch(static_cast<float>(size) * 1e-6f) {
    constexpr double kMostInverse = 1e15;
    for (std::size_t r = 0; r < kRays; ++r)
      for (int k = 0; k < 3; ++k)
        inverse[k][r / 4][r % 4] =
            static_cast<float>(std::clamp(1 / along[r][k], -kMostInverse, kMostInverse));
    for (Lanes& l : limit) l = Lanes{} + std::numeric_limits<float>::max();
    best.fill(kInfinity);
  }
  /// A bit for each ray that may meet the box before what it has met.
  unsigned meets(const Box3d& box) const {
    const Vec3f low = to_float(box.min - origin), high = to_float(box.max - origin);
    using Flags = decltype(Lanes{} < Lanes{});
    Flags met{}, bit{1, 2, 4, 8};
    for (std::size_t g = 0; g < kGroups; ++g, bit <<= 4) {
      Lanes from{}, to = limit[g];
      for (int k = 0; k < 3; ++k) {
        const Lanes a = inverse[k][g] * low[k], b = inverse[k][g] * high[k];
        const Lanes nearer = a < b ? a : b, farther = a > b ? a : b;
        from = from > nearer ? from : nearer;
        to = to < farther ? to : farther;
      }
      met |= (from * (1 - kSlack) <= to * (1 + kSlack) + touch) & bit;
    }
    return static_cast<unsigned>(met[0] | met[1] | met[2] | met[3]);
  }
  void try_triangle(const std::array<Vec3d, 3>& corners, unsigned rays) {
    for (; rays != 0; rays &= rays - 1) {
      const auto r = static_cast<std::size_t>(std::countr_zero(rays));
      const double t = leaving_hit(corners, origin, directions[r]);
      if (t < best[r]) best[r] = t, limit[r / 4][r % 4] = static_cast<float>(t);
    }
  }
};

std::array<double, TriangleTree::kRays> TriangleTree::exits(Vec3d origin, const Rays& directions) const {
  RayBundle rays(origin, directions, box().diagonal());
  Vec3d along;
  for (const Vec3d& d : directions) along = along + d;
  unsigned met = 0;
  walk_boxes(
      nodes_, [&](const Box3d& box) { return (met = rays.meets(box)) != 0; },
      [&](const Box3d& box) { return dot(box.centre() - origin, along); },
      [&](const BoxNode& n) {
        for (std::uint32_t i = n.first; i < n.first + n.count; ++i) rays.try_triangle(corners_[i], met);
      });
  return rays.best;
}

struct TriangleTree::Found {
  OnTriangle on;
  std::uint32_t triangle = 0;
};

TriangleTree::Found TriangleTree::search(Vec3d p, double limit2, std::uint64_t& tried) const {
  Found best;
  best.on.distance2 = limit2;
  const auto distance = [&](const Box3d& box) { return box_distance2(box, p); };
  walk_boxes(
      nodes_, [&](const Box3d& box) { return !(distance(box) >= best.on.distance2); }, distance,
      [&](const BoxNode& n) {
        tried += n.count;
        for (std::uint32_t i = n.first; i < n.first + n.count; ++i)
          if (const OnTriangle on = closest_on_triangle(corners_[i], p); on.distance2 < best.on.distance2)
            best = {on, order_[i]};
      });
  return best;
}

TriangleTree::Nearest TriangleTree::nearest(Vec3d p) const {
  std::uint64_t tried = 0;
  return nearest(p, tried);
}

TriangleTree::Nearest TriangleTree::nearest(Vec3d p, std::uint64_t& tried) const {
  const Found best = search(p, kInfinity, tried);
  return {best.triangle, best.on.weight};
}

double TriangleTree::distance2(Vec3d p, double limit2, std::uint64_t& tried) const {
  const double best = search(p, limit2, tried).on.distance2;
  return best < limit2 ? best : kInfinity;
}

bool TriangleTree::meets(const Tetrahedron& solid, std::uint64_t& tried) const {
  std::array<std::uint32_t, 40> stack{};
  std::size_t depth = 1;
  while (depth > 0) {
    const std::uint32_t at = stack[--depth];
    const BoxNode& n = nodes_[at];
    if (!solid.may_meet_box(n.box)) continue;
    if (n.count == 0) {
      stack[depth++] = n.first;
      stack[depth++] = at + 1;
      continue;
    }
    tried += n.count;
    for (std::uint32_t i = n.first; i < n.first + n.count; ++i)
      if (solid.meets(corners_[i])) return true;
  }
  return false;
}

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
    const BoxNode& n = nodes_[at.node];
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
