#include "stages/ssf/heat_levels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace texmesh {
namespace {

/// A level carries sigmas up to kReach error_ratio spacings; the next one's seeds are kSeed sigma /
/// error_ratio apart, so that a cell holds some eight vertices. Switching at 1.4 made cells of one to four,
/// whose operator was 22 % off on unevenly sampled surfaces (below 0.07 now).
constexpr double kReach = 2.4, kSeed = 0.8;
/// The first scale of a level that starts from a state of 0.65 its sigma is up to a quarter farther off than
/// at 0.4; less is hardly better.
constexpr double kHandover = 0.4;
constexpr double kLeastWeight = 1e-3;
/// Levels of no more vertices carry all the rest: nothing to gain.
constexpr std::size_t kSmallLevel = 2048;

struct Cells {
  std::vector<std::uint32_t> of;    // per fine vertex: its cell
  std::vector<std::uint32_t> seed;  // per cell: fine vertex, rising
};

/// Seeding and Voronoi cells in one go: every new seed takes over what is nearer to it than to those before.
class CellGrower {
 public:
  CellGrower(const HeatLevel& fine, double radius)
      : fine_(fine), radius_(radius), distance_(fine.points.size(), std::numeric_limits<double>::infinity()) {
    cells_.of.resize(fine.points.size());
  }

  Cells grow() {
    for (std::uint32_t v = 0; v < distance_.size(); ++v)
      if (distance_[v] > radius_) grow_from(v);
    return std::move(cells_);
  }

 private:
  void grow_from(std::uint32_t seed) {
    const auto cell = static_cast<std::uint32_t>(cells_.seed.size());
    cells_.seed.push_back(seed);
    assign_to_cell(seed, 0, cell);
    const HeatOperator& l = fine_.laplacian;
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
      const auto [d, v] = heap_.back();
      heap_.pop_back();
      if (d > distance_[v]) continue;
      for (std::uint32_t k = l.first[v]; k < l.first[v + 1]; ++k) {
        const std::uint32_t u = l.column[k];
        const double through = d + length(fine_.points[u] - fine_.points[v]);
        if (through <= radius_ && through < distance_[u]) assign_to_cell(u, through, cell);
      }
    }
  }

  void assign_to_cell(std::uint32_t v, double distance, std::uint32_t cell) {
    distance_[v] = distance;
    cells_.of[v] = cell;
    heap_.emplace_back(distance, v);
    std::push_heap(heap_.begin(), heap_.end(), std::greater<>());
  }

  const HeatLevel& fine_;
  double radius_;
  std::vector<double> distance_;
  std::vector<std::pair<double, std::uint32_t>> heap_;
  Cells cells_;
};

/// Triangles of three cells, each with its lowest cell first.
std::vector<std::uint32_t> dual_triangles(const HeatLevel& fine, const Cells& cells) {
  std::vector<std::array<std::uint32_t, 3>> found;
  for (std::size_t c = 0; c < fine.corners.size(); c += 3) {
    std::array<std::uint32_t, 3> t{cells.of[fine.corners[c]], cells.of[fine.corners[c + 1]],
                                   cells.of[fine.corners[c + 2]]};
    if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) continue;
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    found.push_back(t);
  }
  std::sort(found.begin(), found.end());
  found.erase(std::unique(found.begin(), found.end()), found.end());
  std::vector<std::uint32_t> corners;
  corners.reserve(found.size() * 3);
  for (const auto& t : found) corners.insert(corners.end(), t.begin(), t.end());
  return corners;
}

/// Weights between cells that touch. The heat that a gradient g drives through the fine edges between two
/// cells is sum w_ij g x_ij; the chord X of their seeds lets the same pass when its weight is sum w_ij (x_ij
/// X) / |X|^2. Cotangents of the dual triangles were the alternative: no better on plain surfaces, and off by
/// a third on rods and sheets thinner than a cell, whose dual triangles cut through the inside.
std::vector<HeatChord> find_chords(const HeatLevel& fine, const Cells& cells) {
  const HeatOperator& l = fine.laplacian;
  std::vector<HeatChord> crossing;
  for (std::uint32_t i = 0; i < fine.points.size(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k) {
      const std::uint32_t j = l.column[k], lo = cells.of[i], hi = cells.of[j];
      if (lo >= hi) continue;
      const Vec3d chord = fine.points[cells.seed[hi]] - fine.points[cells.seed[lo]],
                  edge = fine.points[j] - fine.points[i];
      const double square = dot(chord, chord), weight = double{l.rate[k]} * l.mass[i];
      crossing.push_back({lo, hi, square > 0 ? weight * dot(edge, chord) / square : 0});
    }
  std::stable_sort(crossing.begin(), crossing.end(), [](const HeatChord& a, const HeatChord& b) {
    return a.lo != b.lo ? a.lo < b.lo : a.hi < b.hi;
  });
  std::vector<HeatChord> chords;
  for (const HeatChord& c : crossing)
    if (!chords.empty() && chords.back().lo == c.lo && chords.back().hi == c.hi)
      chords.back().weight += c.weight;
    else
      chords.push_back(c);
  // Folded cells may cancel out; the surface must hang together all the same.
  for (HeatChord& c : chords) c.weight = std::max(c.weight, kLeastWeight);
  return chords;
}

double mean_length(const std::vector<Vec3d>& points, const std::vector<HeatChord>& chords) {
  double sum = 0;
  for (const HeatChord& c : chords) sum += length(points[c.hi] - points[c.lo]);
  return sum / std::max(1.0, static_cast<double>(chords.size()));
}

}  // namespace

HeatLevel finest_level(std::vector<Vec3d> points, std::vector<std::uint32_t> corners, double spacing,
                       double rate_cap) {
  HeatLevel level;
  level.spacing = spacing;
  level.laplacian = make_heat_operator({points, corners, {}}, {}, spacing, rate_cap);
  level.points = std::move(points);
  level.corners = std::move(corners);
  level.vertex.resize(level.points.size());
  for (std::uint32_t v = 0; v < level.vertex.size(); ++v) level.vertex[v] = v;
  return level;
}

HeatLevel coarsen(const HeatLevel& fine, double radius, double rate_cap) {
  const Cells cells = CellGrower(fine, radius).grow();
  HeatLevel level;
  level.vertex = cells.seed;
  for (std::uint32_t v : cells.seed) level.points.push_back(fine.points[v]);
  level.corners = dual_triangles(fine, cells);
  const std::vector<HeatChord> chords = find_chords(fine, cells);
  std::vector<double> mass(level.vertex.size(), 0);
  for (std::size_t v = 0; v < cells.of.size(); ++v) mass[cells.of[v]] += fine.laplacian.mass[v];
  // Of a crumpled surface chords stay short while its cells grow.
  level.spacing = std::max(radius, mean_length(level.points, chords));
  level.laplacian = make_heat_operator({level.points, {}, chords}, std::move(mass), level.spacing, rate_cap);
  return level;
}

bool carries(const HeatLevel& level, double sigma, double error_ratio) {
  return level.points.size() <= kSmallLevel || sigma <= kReach * error_ratio * level.spacing;
}

double seed_radius(double sigma, double error_ratio) { return kSeed * sigma / error_ratio; }

double handover_sigma(double first_sigma) { return kHandover * first_sigma; }

}  // namespace texmesh
