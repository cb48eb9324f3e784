#include "stages/proxies/charts/chart_merge.h"

#include <algorithm>
#include <array>
#include <cmath>
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

}  // namespace

ChartMerge::ChartMerge(const ProxySurface& surface)
    : surface_(surface),
      queue_(surface.triangles.size()),
      layout_(surface),
      marks_(surface.positions.size(), 0) {
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
  for (std::uint32_t t = 0; t < count; ++t) {
    chart_of_.push_back(t);
    const double perimeter = lengths_[3 * t] + lengths_[3 * t + 1] + lengths_[3 * t + 2];
    charts_[t] = {{t}, {3 * t, 3 * t + 1, 3 * t + 2}, area_normals_[t], areas_[t], perimeter};
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
    if (later_ones_only && other < chart) continue;
    if (shared_lengths_[other] == 0) neighbours_.push_back(other);
    shared_lengths_[other] += lengths_[h];
  }
  for (const std::uint32_t other : neighbours_)
    queue_.push(chart, other,
                merge_cost(charts_[chart], charts_[other], std::exchange(shared_lengths_[other], 0)));
}

/// Two disks make a disk when what they share is one path of both borders: one corner more than edges. Sheets
/// that meet elsewhere, be it in a corner inside one of them, do not count as one.
bool ChartMerge::makes_disk(std::uint32_t a, std::uint32_t b) {
  round_ += 3;
  const std::uint32_t inside = round_ - 2, on_border = round_ - 1, shared = round_;
  for (const std::uint32_t t : charts_[a].triangles)
    for (const std::uint32_t p : surface_.triangles[t]) marks_[p] = inside;
  std::size_t shared_edges = 0, shared_corners = 0;
  for (const std::uint32_t h : charts_[a].border) {
    marks_[start_of(h)] = on_border;
    shared_edges += opposites_[h] != kNoIndex && chart_of_[opposites_[h] / 3] == b;
  }
  for (const std::uint32_t h : charts_[b].border)
    if (std::uint32_t& mark = marks_[start_of(h)]; mark == on_border) mark = shared, ++shared_corners;
  if (shared_corners != shared_edges + 1) return false;
  return std::all_of(charts_[b].triangles.begin(), charts_[b].triangles.end(), [&](std::uint32_t t) {
    return std::all_of(surface_.triangles[t].begin(), surface_.triangles[t].end(),
                       [&](std::uint32_t p) { return marks_[p] != inside && marks_[p] != on_border; });
  });
}

std::vector<std::uint32_t> ChartMerge::joint_border(std::uint32_t a, std::uint32_t b) const {
  std::vector<std::uint32_t> border;
  for (const auto& [from, to] : {std::pair{a, b}, std::pair{b, a}})
    for (const std::uint32_t h : charts_[from].border)
      if (opposites_[h] == kNoIndex || chart_of_[opposites_[h] / 3] != to) border.push_back(h);
  return border;
}

bool ChartMerge::try_merge(std::uint32_t a, std::uint32_t b) {
  if (charts_[a].triangles.size() < charts_[b].triangles.size()) std::swap(a, b);
  GrowingChart& into = charts_[a];
  GrowingChart& from = charts_[b];
  if (!makes_disk(a, b)) return false;
  std::vector<std::uint32_t> border = joint_border(a, b), triangles = into.triangles;
  triangles.insert(triangles.end(), from.triangles.begin(), from.triangles.end());
  if (!layout_.try_disk(triangles, border, into.area_normal + from.area_normal)) return false;
  layout_.keep_tried(triangles);
  into.border = std::move(border);
  into.area_normal = into.area_normal + from.area_normal;
  into.area += from.area;
  into.perimeter = 0;
  for (const std::uint32_t h : into.border) into.perimeter += lengths_[h];
  for (const std::uint32_t t : from.triangles) chart_of_[t] = a;
  into.triangles = std::move(triangles);
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
