#include "stages/proxies/surface/surface_collapse.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "format/base/no_index.h"

namespace texmesh {
namespace {

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

}  // namespace

SurfaceCollapse::SurfaceCollapse(std::vector<Vec3d> places, std::vector<Triangle> triangles,
                                 const std::vector<std::uint32_t>& group, double border_width)
    : rings_(triangles, places.size()),
      quadrics_(std::move(places), triangles, group, border_width),
      queue_(rings_.vertex_count()) {
  queue_all_edges();
}

Vec3d SurfaceCollapse::doubled_area(std::uint32_t triangle) const {
  const Triangle& t = rings_.triangles()[triangle];
  const Vec3d p = quadrics_.place(t[0]);
  return cross(quadrics_.place(t[1]) - p, quadrics_.place(t[2]) - p);
}

void SurfaceCollapse::queue_all_edges() {
  for (std::uint32_t v = 0; v < rings_.vertex_count(); ++v) {
    if (rings_.valence(v) == 0) continue;
    rings_.triangles_at(v, at_a_);
    neighbours_.clear();
    for (const std::uint32_t t : at_a_)
      for (const std::uint32_t w : rings_.triangles()[t])
        if (w > v) neighbours_.push_back(w);
    std::sort(neighbours_.begin(), neighbours_.end());
    neighbours_.erase(std::unique(neighbours_.begin(), neighbours_.end()), neighbours_.end());
    for (const std::uint32_t w : neighbours_) queue_.push(v, w, quadrics_.best_target(v, w).cost);
  }
}

void SurfaceCollapse::queue_edges_of(std::uint32_t vertex) {
  rings_.triangles_at(vertex, at_a_);
  neighbours_.clear();
  for (const std::uint32_t t : at_a_)
    for (const std::uint32_t w : rings_.triangles()[t])
      if (w != vertex) neighbours_.push_back(w);
  std::sort(neighbours_.begin(), neighbours_.end());
  neighbours_.erase(std::unique(neighbours_.begin(), neighbours_.end()), neighbours_.end());
  for (const std::uint32_t w : neighbours_) queue_.push(vertex, w, quadrics_.best_target(vertex, w).cost);
}

bool SurfaceCollapse::keeps_triangle(std::uint32_t triangle, std::uint32_t a, std::uint32_t b,
                                     Vec3d place) const {
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
  if (!(size_after > 0) || dot(before, after) < limits.least_cosine * size_before * size_after) return false;
  const double round = roundness(after, dot(u, u) + dot(v, v) + dot(w, w));
  if (round >= limits.least_roundness) return true;
  const Vec3d q0 = quadrics_.place(t[0]), q1 = quadrics_.place(t[1]), q2 = quadrics_.place(t[2]);
  const double sides = dot(q1 - q0, q1 - q0) + dot(q2 - q1, q2 - q1) + dot(q0 - q2, q0 - q2);
  return round >= kMostNarrowing * roundness(before, sides);
}

bool SurfaceCollapse::keeps_shape(std::uint32_t a, std::uint32_t b, Vec3d place) const {
  if (guard_ == CollapseGuard::kNone) return true;
  const auto keeps = [&](std::uint32_t t) { return keeps_triangle(t, a, b, place); };
  return std::all_of(at_a_.begin(), at_a_.end(), keeps) && std::all_of(at_b_.begin(), at_b_.end(), keeps);
}

/// Triangles of a and of b with one opposite side: they come to lie on each other.
void SurfaceCollapse::find_folded(std::uint32_t a, std::uint32_t b) {
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
double SurfaceCollapse::folded_cost() const {
  double cost = 0;
  for (const std::uint32_t t : folded_) {
    const double area = length(doubled_area(t)) / 2;
    cost += area * area;
  }
  return cost;
}

void SurfaceCollapse::apply(std::uint32_t a, std::uint32_t b, Vec3d place) {
  for (const std::uint32_t t : folded_) rings_.remove(t);
  for (const std::uint32_t t : at_b_)
    if (rings_.is_live(t) && has(rings_.triangles()[t], a)) rings_.remove(t);
  rings_.merge(b, a);
  quadrics_.merge(b, a, place);
  queue_.touch(a);
  queue_.touch(b);
  queue_edges_of(a);
}

bool SurfaceCollapse::collapse(const QueuedPair& edge) {
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

void SurfaceCollapse::drop_smallest(std::size_t triangle_count) {
  std::vector<std::pair<double, std::uint32_t>> by_area;
  for (std::uint32_t t = 0; t < rings_.triangles().size(); ++t)
    if (rings_.is_live(t)) by_area.emplace_back(length(doubled_area(t)), t);
  std::sort(by_area.begin(), by_area.end());
  for (const auto& [area, t] : by_area) {
    if (rings_.live_count() <= triangle_count) break;
    rings_.remove(t);
  }
}

void SurfaceCollapse::run(std::size_t triangle_count, const RunContext& context) {
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

}  // namespace texmesh
