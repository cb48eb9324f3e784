#include "stages/proxies/charts/chart_merge.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>
#include <span>
#include <utility>

#include "format/base/no_index.h"
#include "format/base/portable_math.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr double kRoundnessShare = 0.3;
// At an edge of more triangles charts end: their pairs would take time that grows with the square.
constexpr std::size_t kMostSheets = 64;
// A pair that was refused is tried again when it has so many times the triangles. Trying it whenever one of
// the two has grown took most of the solver's time; with 4 for 1.25 a turtle had more charts, and .050 for
// .049 at 150 kB.
constexpr double kMuchLarger = 1.25;

}  // namespace

ChartMerge::ChartMerge(const ProxySurface& surface)
    : surface_(surface), queue_(surface.triangles.size()), layout_(surface) {
  measure_triangles();
  find_opposites();
  start_charts();
}

void ChartMerge::find_opposites() {
  std::vector<std::uint32_t> corners;
  corners.reserve(3 * surface_.triangles.size());
  for (const Triangle& t : surface_.triangles) corners.insert(corners.end(), t.begin(), t.end());
  opposites_.assign(corners.size(), kNoIndex);
  const EdgeTable edges = group_edges(corners, surface_.positions.size());
  for (std::size_t e = 0; e < edges.edge_count(); ++e)
    if (edges.edge(e).size() <= kMostSheets) pair_half_edges(edges.edge(e));
}

/// Where several sheets meet in an edge, those go on in each other that turn least.
void ChartMerge::pair_half_edges(std::span<const std::uint32_t> half_edges) {
  struct Candidate {
    double turn;
    std::uint32_t a, b;
    auto operator<=>(const Candidate&) const = default;
  };
  std::vector<Candidate> candidates;
  for (std::size_t i = 0; i < half_edges.size(); ++i)
    for (std::size_t j = i + 1; j < half_edges.size(); ++j) {
      const std::uint32_t a = half_edges[i], b = half_edges[j];
      if (start_of(a) == start_of(b)) continue;  // not the same way round
      if (surface_.group[a / 3] != surface_.group[b / 3]) continue;
      candidates.push_back({-dot(normalized(area_normals_[a / 3]), normalized(area_normals_[b / 3])), a, b});
    }
  std::sort(candidates.begin(), candidates.end());
  for (const auto& [turn, a, b] : candidates)
    if (opposites_[a] == kNoIndex && opposites_[b] == kNoIndex) opposites_[a] = b, opposites_[b] = a;
}

void ChartMerge::measure_triangles() {
  for (const Triangle& t : surface_.triangles) {
    std::array<Vec3d, 3> p;
    for (std::size_t k = 0; k < 3; ++k) p[k] = to_double(surface_.positions[t[k]]);
    area_normals_.push_back(cross(p[1] - p[0], p[2] - p[0]) * 0.5);
    areas_.push_back(length(area_normals_.back()));
    for (std::size_t k = 0; k < 3; ++k) lengths_.push_back(length(p[(k + 1) % 3] - p[k]));
  }
}

void ChartMerge::start_charts() {
  const auto count = static_cast<std::uint32_t>(surface_.triangles.size());
  charts_.resize(count);
  shared_lengths_.assign(count, 0);
  vertices_.resize(3 * std::size_t{count});
  std::iota(vertices_.begin(), vertices_.end(), 0);
  glued_.assign(vertices_.size(), 0);
  renamed_.assign(vertices_.size(), kNoIndex);
  for (std::uint32_t t = 0; t < count; ++t) {
    chart_of_.push_back(t);
    const double perimeter = lengths_[3 * t] + lengths_[3 * t + 1] + lengths_[3 * t + 2];
    charts_[t] = {{t}, {3 * t, 3 * t + 1, 3 * t + 2}, area_normals_[t], areas_[t], perimeter, {}};
  }
  for (std::uint32_t t = 0; t < count; ++t) queue_neighbours(t, true);
}

double ChartMerge::merge_cost(const GrowingChart& a, const GrowingChart& b, double shared_length) const {
  const double area = a.area + b.area;
  const double deviation = 1 - length(a.area_normal + b.area_normal) / area;
  const double perimeter = a.perimeter + b.perimeter - 2 * shared_length;
  return deviation + kRoundnessShare * perimeter * perimeter / (4 * portable::kPi * area);
}

void ChartMerge::queue_neighbours(std::uint32_t chart, bool later_ones_only) {
  neighbours_.clear();
  for (const std::uint32_t h : charts_[chart].border) {
    if (opposites_[h] == kNoIndex) continue;
    const std::uint32_t other = chart_of_[opposites_[h] / 3];
    if (other == chart || (later_ones_only && other < chart)) continue;  // a cut inside the chart
    if (shared_lengths_[other] == 0) neighbours_.push_back(other);
    shared_lengths_[other] += lengths_[h];
  }
  for (const std::uint32_t other : neighbours_)
    queue_.push(chart, other,
                merge_cost(charts_[chart], charts_[other], std::exchange(shared_lengths_[other], 0)));
}

/// Half-edges of a whose opposites are b's, one after the other on both borders: the longest such path. Disks
/// that are glued along one path make a disk, whatever else they share. Empty when they share a whole border.
std::vector<std::uint32_t> ChartMerge::longest_common_path(std::uint32_t a, std::uint32_t b) const {
  std::vector<std::uint32_t> shared;
  for (const std::uint32_t h : charts_[a].border)
    if (opposites_[h] != kNoIndex && chart_of_[opposites_[h] / 3] == b) shared.push_back(h);
  std::sort(shared.begin(), shared.end(),
            [&](std::uint32_t g, std::uint32_t h) { return vertices_[g] < vertices_[h]; });
  const auto following = [&](std::uint32_t h) {
    const std::uint32_t end = vertices_[next_corner(h)];
    const auto at = std::lower_bound(shared.begin(), shared.end(), end,
                                     [&](std::uint32_t g, std::uint32_t v) { return vertices_[g] < v; });
    if (at == shared.end() || vertices_[*at] != end) return kNoIndex;
    return vertices_[next_corner(opposites_[*at])] == vertices_[opposites_[h]] ? *at : kNoIndex;
  };
  std::vector<std::uint32_t> starts = shared;
  for (const std::uint32_t h : shared)
    if (const std::uint32_t next = following(h); next != kNoIndex) std::erase(starts, next);
  std::sort(starts.begin(), starts.end());
  std::vector<std::uint32_t> best;
  double longest = 0;
  for (const std::uint32_t start : starts) {
    std::vector<std::uint32_t> path;
    double path_length = 0;
    for (std::uint32_t h = start; h != kNoIndex; h = following(h)) {
      path.push_back(h);
      path_length += lengths_[h];
    }
    if (path_length > longest) longest = path_length, best = std::move(path);
  }
  if (best.empty()) return best;
  // A path that comes back to its beginning on one of the borders would leave a ring, or a sphere.
  const std::uint32_t first = best.front(), last = best.back();
  if (vertices_[first] == vertices_[next_corner(last)] ||
      vertices_[next_corner(opposites_[first])] == vertices_[opposites_[last]])
    best.pop_back();
  return best;
}

/// Gives the corners of `triangles`, which lie on the other side of the path, the vertices of this side.
void ChartMerge::glue(std::span<const std::uint32_t> path, std::span<const std::uint32_t> triangles) {
  std::vector<std::uint32_t> old;
  const auto rename = [&](std::uint32_t from, std::uint32_t to) {
    renamed_[from] = to;
    old.push_back(from);
  };
  for (const std::uint32_t h : path) {
    rename(vertices_[next_corner(opposites_[h])], vertices_[h]);
    rename(vertices_[opposites_[h]], vertices_[next_corner(h)]);
  }
  for (const std::uint32_t t : triangles)
    for (std::uint32_t c = 3 * t; c < 3 * t + 3; ++c)
      if (renamed_[vertices_[c]] != kNoIndex) vertices_[c] = renamed_[vertices_[c]];
  for (const std::uint32_t v : old) renamed_[v] = kNoIndex;
}

std::vector<std::uint32_t> ChartMerge::joint_border(std::uint32_t a, std::uint32_t b,
                                                    std::span<const std::uint32_t> path) {
  for (const std::uint32_t h : path) glued_[h] = glued_[opposites_[h]] = 1;
  std::vector<std::uint32_t> border;
  for (const std::uint32_t chart : {a, b})
    for (const std::uint32_t h : charts_[chart].border)
      if (!glued_[h]) border.push_back(h);
  for (const std::uint32_t h : path) glued_[h] = glued_[opposites_[h]] = 0;
  return border;
}

/// Whether the first chart remembers that both, when they were not much smaller, made no disk to lay flat.
bool ChartMerge::was_refused(std::uint32_t a, std::uint32_t b) const {
  const auto triangles = static_cast<double>(charts_[a].triangles.size() + charts_[b].triangles.size());
  return std::ranges::any_of(charts_[a].refusals, [&](const GrowingChart::Refusal& r) {
    return chart_of_[r.triangle] == b && triangles < kMuchLarger * static_cast<double>(r.triangles);
  });
}

bool ChartMerge::try_merge(std::uint32_t a, std::uint32_t b) {
  if (charts_[a].triangles.size() < charts_[b].triangles.size()) std::swap(a, b);
  GrowingChart& into = charts_[a];
  GrowingChart& from = charts_[b];
  if (was_refused(a, b) || was_refused(b, a)) return false;
  const std::vector<std::uint32_t> path = longest_common_path(a, b);
  if (path.empty()) return false;  // they close around each other
  std::vector<std::uint32_t> border = joint_border(a, b, path), triangles = into.triangles, before;
  triangles.insert(triangles.end(), from.triangles.begin(), from.triangles.end());
  for (const std::uint32_t t : from.triangles)
    before.insert(before.end(), &vertices_[3 * t], &vertices_[3 * t] + 3);
  glue(path, from.triangles);
  if (!layout_.try_disk(triangles, border, vertices_, into.area_normal + from.area_normal)) {
    for (std::size_t i = 0; i < before.size(); ++i) vertices_[3 * from.triangles[i / 3] + i % 3] = before[i];
    into.refusals.push_back({from.triangles.front(), triangles.size()});
    return false;
  }
  layout_.keep_tried(triangles);
  into.border = std::move(border);
  into.area_normal = into.area_normal + from.area_normal;
  into.area += from.area;
  into.perimeter = 0;
  for (const std::uint32_t h : into.border) into.perimeter += lengths_[h];
  for (const std::uint32_t t : from.triangles) chart_of_[t] = a;
  into.triangles = std::move(triangles);
  into.refusals.insert(into.refusals.end(), from.refusals.begin(), from.refusals.end());
  std::erase_if(into.refusals, [&](const GrowingChart::Refusal& r) { return chart_of_[r.triangle] == a; });
  from = {};
  queue_.touch(a);
  queue_.touch(b);
  queue_neighbours(a, false);
  return true;
}

void ChartMerge::run(const RunContext& context) {
  for (std::size_t steps = 0; !queue_.empty(); ++steps) {
    if (steps % 1024 == 0) context.check_cancelled();
    if (const QueuedPair pair = queue_.pop(); queue_.is_fresh(pair)) try_merge(pair.a, pair.b);
  }
}

}  // namespace texmesh
