#include "stages/proxies/surface/surface_quadrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>
#include <utility>

#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

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

}  // namespace

double area_of(const std::vector<Vec3d>& places, const std::vector<Triangle>& triangles) {
  double sum = 0;
  for (const Triangle& t : triangles) sum += length(doubled_area(places, t)) / 2;
  return sum;
}

SurfaceQuadrics::SurfaceQuadrics(std::vector<Vec3d> places, const std::vector<Triangle>& triangles,
                                 const std::vector<std::uint32_t>& group, double border_width)
    : places_(std::move(places)), quadrics_(places_.size()) {
  add_triangles(triangles);
  add_borders(triangles, group, border_width);
}

void SurfaceQuadrics::add_triangles(const std::vector<Triangle>& triangles) {
  for (const Triangle& t : triangles) {
    const Vec3d n = doubled_area(places_, t);
    const double area2 = length(n);
    if (!(area2 > 0)) continue;
    const Vec3d unit = n * (1 / area2);
    for (const std::uint32_t v : t) quadrics_[v].add_plane(unit, -dot(unit, places_[t[0]]), area2 / 6);
  }
}

void SurfaceQuadrics::add_borders(const std::vector<Triangle>& triangles,
                                  const std::vector<std::uint32_t>& group, double border_width) {
  const std::vector<double> area = component_areas(places_, triangles);
  std::vector<std::uint32_t> corners;
  corners.reserve(3 * triangles.size());
  for (const Triangle& t : triangles) corners.insert(corners.end(), t.begin(), t.end());
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

double SurfaceQuadrics::cost_at(const Quadric& sum, std::uint32_t a, std::uint32_t b, Vec3d place) const {
  const Vec3d edge = places_[b] - places_[a];
  return sum.at(place) + kLengthCost * sum.weight * dot(edge, edge);
}

SurfaceQuadrics::Target SurfaceQuadrics::best_target(std::uint32_t a, std::uint32_t b) const {
  Quadric sum = quadrics_[a];
  sum.add(quadrics_[b]);
  const Vec3d middle = (places_[a] + places_[b]) * 0.5;
  const Vec3d gradient{sum.xx * middle.x + sum.xy * middle.y + sum.xz * middle.z + sum.bx,
                       sum.xy * middle.x + sum.yy * middle.y + sum.yz * middle.z + sum.by,
                       sum.xz * middle.x + sum.yz * middle.y + sum.zz * middle.z + sum.bz};
  const Vec3d place = middle + solve(sum, gradient, kPull * sum.weight);
  return {place, cost_at(sum, a, b, place)};
}

SurfaceQuadrics::Target SurfaceQuadrics::plain_target(std::uint32_t a, std::uint32_t b) const {
  Quadric sum = quadrics_[a];
  sum.add(quadrics_[b]);
  Target best{(places_[a] + places_[b]) * 0.5, 0};
  best.cost = cost_at(sum, a, b, best.place);
  for (const Vec3d place : {places_[a], places_[b]})
    if (const double cost = cost_at(sum, a, b, place); cost < best.cost) best = {place, cost};
  return best;
}

void SurfaceQuadrics::merge(std::uint32_t from, std::uint32_t to, Vec3d place) {
  quadrics_[to].add(quadrics_[from]);
  places_[to] = place;
}

}  // namespace texmesh
