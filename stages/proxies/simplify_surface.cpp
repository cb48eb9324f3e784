// How a soup gets coarse. clean_soup() welds it. SurfaceQuadrics gives each vertex the planes that it stands
// for. SurfaceCollapse joins the two ends of an edge, cheapest first, on CornerRings, which know the
// triangles at a vertex. Where nothing goes any more the guards of shape are loosened, and at last the
// smallest triangles are dropped, so that every count is reached.
#include "stages/proxies/simplify_surface.h"

#include "format/base/numbering.h"
#include "stages/charts/chart_parts.h"
#include "stages/geometry/mesh_topology.h"
#include "stages/geometry/quadric.h"

namespace texmesh {
namespace {

/// Whether triangles without an area stay: in a source they close cracks between their neighbours.
enum class ZeroArea : std::uint8_t { kKeep, kDrop };

/// The lowest corner first; direction stays.
Triangle lowest_first(Triangle t) {
  std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  return t;
}

/// Sets `dropped` for triangles that repeat one before them.
void drop_repeated(const std::vector<Triangle>& triangles, const std::vector<std::uint32_t>& group,
                   std::vector<std::uint8_t>& dropped) {
  struct Key {
    Triangle corners;
    std::uint32_t group, triangle;
    auto operator<=>(const Key&) const = default;
  };
  std::vector<Key> keys;
  keys.reserve(triangles.size());
  for (std::uint32_t t = 0; t < triangles.size(); ++t)
    if (!dropped[t]) keys.push_back({lowest_first(triangles[t]), group[t], t});
  std::sort(keys.begin(), keys.end());
  for (std::size_t i = 1; i < keys.size(); ++i)
    if (keys[i].corners == keys[i - 1].corners && keys[i].group == keys[i - 1].group)
      dropped[keys[i].triangle] = 1;
}

/// Positions that triangles have, in order, and the triangles with their indices; a missing corner's is
/// kNoIndex. Late in a simplification few of all positions are left, and welding sorts them.
struct UsedSoup {
  std::vector<Vec3f> points;
  std::vector<Triangle> triangles;
  UsedSoup(std::span<const Vec3f> positions, std::span<const Triangle> given)
      : triangles(given.begin(), given.end()) {
    std::vector<std::uint32_t> at(positions.size(), kNoIndex);
    for (const Triangle& t : given)
      for (const std::uint32_t p : t)
        if (p < at.size()) at[p] = 0;
    for (std::size_t p = 0; p < at.size(); ++p) {
      if (at[p] == kNoIndex) continue;
      at[p] = static_cast<std::uint32_t>(points.size());
      points.push_back(positions[p]);
    }
    for (Triangle& t : triangles)
      for (std::uint32_t& p : t) p = p < at.size() ? at[p] : kNoIndex;
  }
};

bool has_area(const std::vector<Vec3f>& positions, const Triangle& t) {
  const Vec3d a = to_double(positions[t[0]]);
  const Vec3d n = cross(to_double(positions[t[1]]) - a, to_double(positions[t[2]]) - a);
  return dot(n, n) > 0;
}

/// Welds equal positions and drops triangles with equal, non-finite or missing corners, those that repeat
/// another one's corners and direction within a group, and positions without a triangle. Order stays.
ProxySurface clean_soup(std::span<const Vec3f> positions, std::span<const Triangle> triangles,
                        std::span<const std::uint32_t> group, ZeroArea zero_area) {
  const UsedSoup used(positions, triangles);
  const std::vector<Vec3f>& points = used.points;
  const std::vector<std::uint32_t> weld = weld_positions(points, 0);
  std::vector<Triangle> welded(triangles.size());
  std::vector<std::uint32_t> groups(triangles.size(), 0);
  std::vector<std::uint8_t> dropped(triangles.size(), 0);
  for (std::size_t t = 0; t < triangles.size(); ++t) {
    Triangle& w = welded[t];
    for (std::size_t k = 0; k < 3; ++k)
      w[k] = used.triangles[t][k] != kNoIndex ? weld[used.triangles[t][k]] : kNoIndex;
    const bool sound = w[0] != kNoIndex && w[1] != kNoIndex && w[2] != kNoIndex && w[0] != w[1] &&
                       w[1] != w[2] && w[2] != w[0];
    dropped[t] = !sound || (zero_area == ZeroArea::kDrop && !has_area(points, w));
    if (t < group.size()) groups[t] = group[t];
  }
  drop_repeated(welded, groups, dropped);

  ProxySurface surface;
  std::vector<std::uint32_t> at(points.size(), kNoIndex);
  for (std::size_t t = 0; t < welded.size(); ++t) {
    if (dropped[t]) continue;
    for (std::uint32_t& corner : welded[t]) corner = numbered(at[corner], surface.positions, points[corner]);
    surface.triangles.push_back(welded[t]);
    surface.group.push_back(groups[t]);
  }
  return surface;
}

/// Triangles of vertices that merge pairwise. The corners at a vertex form a ring, so that two vertices merge
/// in the time that the smaller number of corners takes to be renamed; any soup will do.
class CornerRings {
 public:
  CornerRings(std::vector<Triangle> triangles, std::size_t vertex_count)
      : triangles_(std::move(triangles)),
        live_(triangles_.size(), 1),
        next_(3 * triangles_.size()),
        first_(vertex_count, kNoIndex),
        valence_(vertex_count, 0),
        live_count_(triangles_.size()) {
    for (std::uint32_t c = 0; c < next_.size(); ++c) {
      const std::uint32_t v = triangles_[c / 3][c % 3];
      if (first_[v] == kNoIndex)
        first_[v] = next_[c] = c;
      else
        next_[c] = std::exchange(next_[first_[v]], c);
      ++valence_[v];
    }
  }

  std::size_t live_count() const { return live_count_; }
  std::size_t vertex_count() const { return first_.size(); }
  const std::vector<Triangle>& triangles() const { return triangles_; }
  bool is_live(std::uint32_t triangle) const { return live_[triangle] != 0; }
  /// How many live triangles the vertex has.
  std::uint32_t valence(std::uint32_t vertex) const { return valence_[vertex]; }

  /// Live triangles at the vertex, in the ring's order. Forgets dead ones.
  void triangles_at(std::uint32_t vertex, std::vector<std::uint32_t>& out) {
    out.clear();
    const std::uint32_t start = first_[vertex];
    if (start == kNoIndex) return;
    std::uint32_t last = kNoIndex, head = kNoIndex, c = start;
    do {
      const std::uint32_t following = next_[c];
      if (live_[c / 3]) {
        out.push_back(c / 3);
        if (last == kNoIndex)
          head = c;
        else
          next_[last] = c;
        last = c;
      }
      c = following;
    } while (c != start);
    if (last != kNoIndex) next_[last] = head;
    first_[vertex] = head;
  }

  void remove(std::uint32_t triangle) {
    live_[triangle] = 0;
    --live_count_;
    for (const std::uint32_t v : triangles_[triangle]) --valence_[v];
  }

  /// The vertex `from` becomes `to`. Triangles that have both are removed before.
  void merge(std::uint32_t from, std::uint32_t to) {
    const std::uint32_t start = std::exchange(first_[from], kNoIndex);
    if (start == kNoIndex) return;
    std::uint32_t c = start;
    do {
      triangles_[c / 3][c % 3] = to;
      c = next_[c];
    } while (c != start);
    if (first_[to] == kNoIndex)
      first_[to] = start;
    else
      std::swap(next_[first_[to]], next_[start]);
    valence_[to] += std::exchange(valence_[from], 0);
  }

 private:
  std::vector<Triangle> triangles_;
  std::vector<std::uint8_t> live_;      // per triangle
  std::vector<std::uint32_t> next_;     // per corner 3 t + k: the next one of the ring
  std::vector<std::uint32_t> first_;    // per vertex: a corner of its ring, or kNoIndex
  std::vector<std::uint32_t> valence_;  // per vertex
  std::size_t live_count_;
};

// Pulls a place towards the edge's middle where planes leave it free. On curved parts the planes decide: at
// the sizes of proxies their least eigenvalue is about 20 times as much.
constexpr double kPull = 1e-3;
// A long collapse costs a little even on a plane, so that vertices stay evenly spread there and triangles
// keep their shape.
constexpr double kLengthCost = 1e-5;

Vec3d doubled_area(const std::vector<Vec3d>& places, const Triangle& t) {
  return cross(places[t[1]] - places[t[0]], places[t[2]] - places[t[0]]);
}

/// Per vertex: the area of its component.
std::vector<double> component_areas(const std::vector<Vec3d>& places,
                                    const std::vector<Triangle>& triangles) {
  DisjointSets sets(places.size());
  for (const Triangle& t : triangles) sets.join(t[0], t[1]), sets.join(t[1], t[2]);
  std::vector<double> area(places.size(), 0);
  for (const Triangle& t : triangles) area[sets.find(t[0])] += length(doubled_area(places, t)) / 2;
  for (std::uint32_t v = 0; v < area.size(); ++v) area[v] = area[sets.find(v)];  // names are lowest members
  return area;
}

/// x of (A + pull I) x = -g, by Cramer's rule; A is positive semidefinite, so the determinant is positive.
Vec3d solve(const Quadric& q, Vec3d g, double pull) {
  const Vec3d r0{q.xx + pull, q.xy, q.xz}, r1{q.xy, q.yy + pull, q.yz}, r2{q.xz, q.yz, q.zz + pull};
  const Vec3d c12 = cross(r1, r2), c20 = cross(r2, r0), c01 = cross(r0, r1);
  const double determinant = dot(r0, c12);
  if (!(determinant > 0)) return {};
  return (c12 * g.x + c20 * g.y + c01 * g.z) * (-1 / determinant);
}

/// Sum over triangles, in double.
double area_of(const std::vector<Vec3d>& places, const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const Triangle& t : triangles) sum += length(doubled_area(places, t)) / 2;
  return sum;
}

/// Vertices with the planes of the triangles and borders that they stand for.
/// Borders, and outlines of groups, get planes that stand upright on their triangles. A border's weight is
/// its length times border_width: as if a strip of that width stood there. So it does not depend on how
/// finely the border is divided. A component has no wider strip than the side of a square of its area, so
/// dust is not held by its borders.
class SurfaceQuadrics {
 public:
  SurfaceQuadrics(std::vector<Vec3d> places, const std::vector<Triangle>& triangles,
                  const std::vector<std::uint32_t>& group, double border_width)
      : places_(std::move(places)), quadrics_(places_.size()) {
    add_triangles(triangles);
    add_borders(triangles, group, border_width);
  }

  struct Target {
    Vec3d place;
    double cost = 0;  // area times squared distance
  };
  const Vec3d& place(std::uint32_t vertex) const { return places_[vertex]; }
  const std::vector<Vec3d>& places() const { return places_; }
  /// The cheapest place for two vertices that become one.
  Target best_target(std::uint32_t a, std::uint32_t b) const {
    Quadric sum = quadrics_[a];
    sum.add(quadrics_[b]);
    const Vec3d middle = (places_[a] + places_[b]) * 0.5;
    const Vec3d gradient{sum.xx * middle.x + sum.xy * middle.y + sum.xz * middle.z + sum.bx,
                         sum.xy * middle.x + sum.yy * middle.y + sum.yz * middle.z + sum.by,
                         sum.xz * middle.x + sum.yz * middle.y + sum.zz * middle.z + sum.bz};
    const Vec3d place = middle + solve(sum, gradient, kPull * sum.weight);
    return {place, cost_at(sum, a, b, place)};
  }

  /// The cheapest of both ends and the middle.
  Target plain_target(std::uint32_t a, std::uint32_t b) const {
    Quadric sum = quadrics_[a];
    sum.add(quadrics_[b]);
    Target best{(places_[a] + places_[b]) * 0.5, 0};
    best.cost = cost_at(sum, a, b, best.place);
    for (const Vec3d place : {places_[a], places_[b]})
      if (const double cost = cost_at(sum, a, b, place); cost < best.cost) best = {place, cost};
    return best;
  }

  void merge(std::uint32_t from, std::uint32_t to, Vec3d place) {
    quadrics_[to].add(quadrics_[from]);
    places_[to] = place;
  }

 private:
  double cost_at(const Quadric& sum, std::uint32_t a, std::uint32_t b, Vec3d place) const {
    const Vec3d edge = places_[b] - places_[a];
    return sum.at(place) + kLengthCost * sum.weight * dot(edge, edge);
  }

  void add_triangles(const std::vector<Triangle>& triangles) {
    for (const Triangle& t : triangles) {
      const Vec3d n = doubled_area(places_, t);
      const double area2 = length(n);
      if (!(area2 > 0)) continue;
      const Vec3d unit = n * (1 / area2);
      for (const std::uint32_t v : t) quadrics_[v].add_plane(unit, -dot(unit, places_[t[0]]), area2 / 6);
    }
  }

  void add_borders(const std::vector<Triangle>& triangles, const std::vector<std::uint32_t>& group,
                   double border_width) {
    const std::vector<double> area = component_areas(places_, triangles);
    const std::span<const std::uint32_t> corners = corners_of(triangles);
    const EdgeTable edges = group_edges(corners, places_.size());
    for (std::size_t e = 0; e < edges.edge_count(); ++e) {
      const std::span<const std::uint32_t> half_edges = edges.edge(e);
      const std::uint32_t first_group = group[half_edges[0] / 3];
      const bool one_group = std::all_of(half_edges.begin(), half_edges.end(),
                                         [&](std::uint32_t h) { return group[h / 3] == first_group; });
      if (half_edges.size() > 1 && one_group) continue;
      for (const std::uint32_t h : half_edges) {
        const std::uint32_t a = corners[h], b = corners[next_corner(h)];
        const Vec3d along = places_[b] - places_[a];
        const Vec3d upright = normalized(cross(along, doubled_area(places_, triangles[h / 3])));
        const double weight = length(along) * std::min(border_width, std::sqrt(area[a]));
        const double d = -dot(upright, places_[a]);
        quadrics_[a].add_plane(upright, d, weight / 2);
        quadrics_[b].add_plane(upright, d, weight / 2);
      }
    }
  }

  std::vector<Vec3d> places_;
  std::vector<Quadric> quadrics_;
};

/// How much shape a collapse may cost. A run starts with kFair; the others take over when nothing else goes.
enum class CollapseGuard : std::uint8_t { kFair, kLax, kNone };

// A vertex with more triangles stays: its collapse takes time in proportion, and a fan of a million triangles
// would take it a million times.
constexpr std::uint32_t kMostTriangles = 512;
// How often a refused edge is offered again at twice the cost, when its neighbours may have changed.
constexpr std::uint32_t kMostTries = 6;
// How far a triangle may turn (cosine) and how narrow it may become. The roundness of an equilateral triangle
// is 1.
struct GuardLimits {
  double least_cosine, least_roundness;
};
constexpr std::array<GuardLimits, 3> kGuardLimits{{{0.2, 0.08}, {-0.2, 0}, {-2, 0}}};
constexpr double kMostNarrowing = 0.7;  // a narrow triangle may lose this much more

double roundness(Vec3d doubled_area, double squared_sides) {
  return squared_sides > 0 ? 2 * std::sqrt(3.0) * length(doubled_area) / squared_sides : 0;
}

bool has(const Triangle& t, std::uint32_t v) { return t[0] == v || t[1] == v || t[2] == v; }

/// The corners but `v`, in the triangle's direction.
std::array<std::uint32_t, 2> opposite_side(const Triangle& t, std::uint32_t v) {
  if (t[0] == v) return {t[1], t[2]};
  return t[1] == v ? std::array{t[2], t[0]} : std::array{t[0], t[1]};
}

/// Collapses edges of a soup, cheapest first.
class SurfaceCollapse {
 public:
  SurfaceCollapse(std::vector<Vec3d> places, std::vector<Triangle> triangles,
                  const std::vector<std::uint32_t>& group, double border_width)
      : rings_(triangles, places.size()),
        quadrics_(std::move(places), triangles, group, border_width),
        queue_(rings_.vertex_count()) {
    queue_all_edges();
  }

  /// Goes on until at most `triangle_count` (>= 1) triangles are left. Throws Cancelled.
  void run(std::size_t triangle_count, const RunContext& context) {
    std::size_t at_last_filling = rings_.live_count();
    for (std::size_t steps = 0; rings_.live_count() > triangle_count; ++steps) {
      if (steps % 4096 == 0) context.check_cancelled();
      if (queue_.empty()) {
        if (rings_.live_count() == at_last_filling) {
          if (guard_ == CollapseGuard::kNone) return drop_smallest(triangle_count);
          guard_ = guard_ == CollapseGuard::kFair ? CollapseGuard::kLax : CollapseGuard::kNone;
        }
        at_last_filling = rings_.live_count();
        queue_all_edges();
        if (queue_.empty()) return drop_smallest(triangle_count);
      }
      if (const QueuedPair edge = queue_.pop(); queue_.is_fresh(edge)) collapse(edge);
    }
  }

  const CornerRings& rings() const { return rings_; }
  const std::vector<Vec3d>& places() const { return quadrics_.places(); }

 private:
  void queue_all_edges() {
    for (std::uint32_t v = 0; v < rings_.vertex_count(); ++v)
      if (rings_.valence(v) > 0) queue_edges_of(v, v + 1);
  }

  /// Those to vertices from `first` on.
  void queue_edges_of(std::uint32_t vertex, std::uint32_t first) {
    rings_.triangles_at(vertex, at_a_);
    neighbours_.clear();
    for (const std::uint32_t t : at_a_)
      for (const std::uint32_t w : rings_.triangles()[t])
        if (w >= first && w != vertex) neighbours_.push_back(w);
    std::sort(neighbours_.begin(), neighbours_.end());
    neighbours_.erase(std::unique(neighbours_.begin(), neighbours_.end()), neighbours_.end());
    for (const std::uint32_t w : neighbours_) queue_.push(vertex, w, quadrics_.best_target(vertex, w).cost);
  }

  bool collapse(const QueuedPair& edge) {
    const auto [cost, a, b, stamp, tries] = edge;
    if (rings_.valence(a) + rings_.valence(b) > kMostTriangles) return false;
    rings_.triangles_at(a, at_a_);
    rings_.triangles_at(b, at_b_);
    if (std::none_of(at_b_.begin(), at_b_.end(),
                     [&, v = a](std::uint32_t t) { return has(rings_.triangles()[t], v); }))
      return false;  // the edge's triangles have vanished
    find_folded(a, b);
    const double extra = folded_cost();
    SurfaceQuadrics::Target target = quadrics_.best_target(a, b);
    if (!keeps_shape(a, b, target.place)) {
      target = quadrics_.plain_target(a, b);
      if (!keeps_shape(a, b, target.place)) {
        if (tries < kMostTries) queue_.push(a, b, 2 * std::max(double{cost}, target.cost), tries + 1);
        return false;
      }
    }
    if (const double needed = target.cost + extra; needed > 1.001 * double{cost} + 1e-30) {
      queue_.push(a, b, needed, tries);
      return false;
    }
    apply(a, b, target.place);
    return true;
  }

  bool keeps_shape(std::uint32_t a, std::uint32_t b, Vec3d place) const {
    if (guard_ == CollapseGuard::kNone) return true;
    const auto keeps = [&](std::uint32_t t) { return keeps_triangle(t, a, b, place); };
    return std::all_of(at_a_.begin(), at_a_.end(), keeps) && std::all_of(at_b_.begin(), at_b_.end(), keeps);
  }

  bool keeps_triangle(std::uint32_t triangle, std::uint32_t a, std::uint32_t b, Vec3d place) const {
    const Triangle& t = rings_.triangles()[triangle];
    if (has(t, a) && has(t, b)) return true;  // vanishes
    const Vec3d before = doubled_area(triangle);
    const double size_before = length(before);
    if (!(size_before > 0)) return true;
    std::array<Vec3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = t[k] == a || t[k] == b ? place : quadrics_.place(t[k]);
    const Vec3d u = p[1] - p[0], v = p[2] - p[1], w = p[0] - p[2], after = cross(u, p[2] - p[0]);
    const double size_after = length(after);
    const GuardLimits limits = kGuardLimits[static_cast<std::size_t>(guard_)];
    if (!(size_after > 0) || dot(before, after) < limits.least_cosine * size_before * size_after)
      return false;
    const double round = roundness(after, dot(u, u) + dot(v, v) + dot(w, w));
    if (round >= limits.least_roundness) return true;
    const Vec3d q0 = quadrics_.place(t[0]), q1 = quadrics_.place(t[1]), q2 = quadrics_.place(t[2]);
    const double sides = dot(q1 - q0, q1 - q0) + dot(q2 - q1, q2 - q1) + dot(q0 - q2, q0 - q2);
    return round >= kMostNarrowing * roundness(before, sides);
  }

  /// Triangles of a and of b with one opposite side: they come to lie on each other.
  void find_folded(std::uint32_t a, std::uint32_t b) {
    folded_.clear();
    for (const std::uint32_t s : at_a_) {
      if (has(rings_.triangles()[s], b)) continue;
      const auto [s0, s1] = opposite_side(rings_.triangles()[s], a);
      for (const std::uint32_t t : at_b_) {
        if (has(rings_.triangles()[t], a)) continue;
        const auto [t0, t1] = opposite_side(rings_.triangles()[t], b);
        const bool taken = std::find(folded_.begin(), folded_.end(), t) != folded_.end();
        if (taken) continue;
        if (s0 == t1 && s1 == t0) {  // back to back: nothing is left between them
          folded_.push_back(s);
          folded_.push_back(t);
          break;
        }
        if (s0 == t0 && s1 == t1) folded_.push_back(t);
      }
    }
  }

  /// What vanishes with folded triangles is a thin tip, or a component's last triangles. Planes do not count
  /// it, so it costs as if its area moved by its own size.
  double folded_cost() const {
    double cost = 0;
    for (const std::uint32_t t : folded_) {
      const double area = length(doubled_area(t)) / 2;
      cost += area * area;
    }
    return cost;
  }

  void apply(std::uint32_t a, std::uint32_t b, Vec3d place) {
    for (const std::uint32_t t : folded_) rings_.remove(t);
    for (const std::uint32_t t : at_b_)
      if (rings_.is_live(t) && has(rings_.triangles()[t], a)) rings_.remove(t);
    rings_.merge(b, a);
    quadrics_.merge(b, a, place);
    queue_.touch(a);
    queue_.touch(b);
    queue_edges_of(a, 0);
  }

  void drop_smallest(std::size_t triangle_count) {
    std::vector<std::pair<double, std::uint32_t>> by_area;
    for (std::uint32_t t = 0; t < rings_.triangles().size(); ++t)
      if (rings_.is_live(t)) by_area.emplace_back(length(doubled_area(t)), t);
    std::sort(by_area.begin(), by_area.end());
    for (const auto& [area, t] : by_area) {
      if (rings_.live_count() <= triangle_count) break;
      rings_.remove(t);
    }
  }

  Vec3d doubled_area(std::uint32_t triangle) const {
    return texmesh::doubled_area(quadrics_.places(), rings_.triangles()[triangle]);
  }

  CornerRings rings_;
  SurfaceQuadrics quadrics_;
  PairQueue queue_;
  CollapseGuard guard_ = CollapseGuard::kFair;
  std::vector<std::uint32_t> at_a_, at_b_;  // triangles of the edge in hand
  std::vector<std::uint32_t> folded_;       // those that lie on each other after the collapse in hand
  std::vector<std::uint32_t> neighbours_;
};

/// Places in a box of side 1 around 0, where squares of squares neither overflow nor vanish.
struct UnitFrame {
  Vec3d centre;
  double side = 1;
  explicit UnitFrame(const std::vector<Vec3f>& positions) {
    const Box3d box = to_double(bounding_box(positions));
    if (box.empty()) return;
    centre = box.centre();
    if (box.longest_side() > 0) side = box.longest_side();
  }
  std::vector<Vec3d> places(const std::vector<Vec3f>& positions) const {
    std::vector<Vec3d> out;
    out.reserve(positions.size());
    for (const Vec3f p : positions) out.push_back((to_double(p) - centre) * (1 / side));
    return out;
  }
  Vec3f position(Vec3d place) const { return to_float(place * side + centre); }
};

ProxySurface snapshot(const SurfaceCollapse& collapse, const UnitFrame& frame,
                      const std::vector<std::uint32_t>& source_group) {
  std::vector<Vec3f> positions;
  positions.reserve(collapse.places().size());
  for (const Vec3d& p : collapse.places()) positions.push_back(frame.position(p));
  std::vector<Triangle> triangles;
  std::vector<std::uint32_t> group;
  const CornerRings& rings = collapse.rings();
  for (std::uint32_t t = 0; t < rings.triangles().size(); ++t) {
    if (!rings.is_live(t)) continue;
    triangles.push_back(rings.triangles()[t]);
    group.push_back(source_group[t]);
  }
  return clean_soup(positions, triangles, group, ZeroArea::kDrop);
}

/// An edge's length at the sizes asked for: what a border's move by as much would take from the picture.
double typical_edge(double area, std::span<const std::uint32_t> triangle_counts) {
  if (triangle_counts.empty()) return 0;
  const double middle = std::sqrt(1.0 * triangle_counts.front() * triangle_counts.back());
  return std::sqrt(area / std::max(middle, 1.0));
}

}  // namespace

std::vector<ProxySurface> simplify_surface(std::span<const Vec3f> positions,
                                           std::span<const Triangle> triangles,
                                           std::span<const std::uint32_t> group,
                                           std::span<const std::uint32_t> triangle_counts,
                                           const RunContext& context) {
  ProxySurface soup = clean_soup(positions, triangles, group, ZeroArea::kKeep);
  const UnitFrame frame(soup.positions);
  std::vector<Vec3d> places = frame.places(soup.positions);
  const double border_width = typical_edge(area_of(places, soup.triangles), triangle_counts);
  SurfaceCollapse collapse(std::move(places), std::move(soup.triangles), soup.group, border_width);
  std::vector<ProxySurface> surfaces;
  for (const std::uint32_t count : triangle_counts) {
    collapse.run(std::max(count, 1u), context);
    surfaces.push_back(snapshot(collapse, frame, soup.group));
  }
  return surfaces;
}

}  // namespace texmesh
