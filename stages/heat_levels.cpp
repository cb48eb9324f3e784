#include "stages/heat_levels.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <utility>

namespace texmesh {
namespace {

/// A level carries sigmas up to kReach error_ratio spacings; the next one's seeds are kSeed sigma /
/// error_ratio apart.
constexpr double kReach = 1.4, kSeed = 0.8;
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
      : fine_(fine),
        radius_(radius),
        distance_(fine.points.size(), std::numeric_limits<double>::infinity()) {
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
    take(seed, 0, cell);
    const HeatOperator& l = fine_.laplacian;
    while (!heap_.empty()) {
      std::pop_heap(heap_.begin(), heap_.end(), std::greater<>());
      const auto [d, v] = heap_.back();
      heap_.pop_back();
      if (d > distance_[v]) continue;
      for (std::uint32_t k = l.first[v]; k < l.first[v + 1]; ++k) {
        const std::uint32_t u = l.column[k];
        const double through = d + length(fine_.points[u] - fine_.points[v]);
        if (through <= radius_ && through < distance_[u]) take(u, through, cell);
      }
    }
  }

  void take(std::uint32_t v, double distance, std::uint32_t cell) {
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

/// Pairs of cells that are edges of triangles, as sorted rows of the lower one's partners.
class CellPairs {
 public:
  CellPairs(const std::vector<std::uint32_t>& corners, std::size_t cells) : first_(cells + 1, 0) {
    const auto each = [&](auto&& visit) {
      for (std::size_t c = 0; c < corners.size(); c += 3)
        for (std::size_t k = 0; k < 3; ++k) {
          const auto [lo, hi] = std::minmax(corners[c + k], corners[c + (k + 1) % 3]);
          visit(lo, hi);
        }
    };
    each([&](std::uint32_t lo, std::uint32_t) { ++first_[lo + 1]; });
    for (std::size_t i = 0; i < cells; ++i) first_[i + 1] += first_[i];
    partner_.resize(first_.back());
    std::vector<std::uint32_t> at(first_.begin(), first_.end() - 1);
    each([&](std::uint32_t lo, std::uint32_t hi) { partner_[at[lo]++] = hi; });
    for (std::size_t i = 0; i < cells; ++i)
      std::sort(partner_.begin() + first_[i], partner_.begin() + first_[i + 1]);
  }
  bool contains(std::uint32_t lo, std::uint32_t hi) const {
    return std::binary_search(partner_.begin() + first_[lo], partner_.begin() + first_[lo + 1], hi);
  }

 private:
  std::vector<std::uint32_t> first_, partner_;
};

/// Cells that touch but share no triangle. The heat that a gradient g drives through the fine edges is sum
/// w_ij g x_ij; the chord X lets the same pass when its weight is sum w_ij (x_ij X) / |X|^2.
std::vector<HeatChord> find_chords(const HeatLevel& fine, const Cells& cells,
                                   const std::vector<std::uint32_t>& corners) {
  const CellPairs joined(corners, cells.seed.size());
  const HeatOperator& l = fine.laplacian;
  std::vector<HeatChord> crossing;
  for (std::uint32_t i = 0; i < fine.points.size(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k) {
      const std::uint32_t j = l.column[k], lo = cells.of[i], hi = cells.of[j];
      if (lo >= hi || joined.contains(lo, hi)) continue;
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
  for (HeatChord& c : chords) c.weight = std::max(c.weight, 1e-3);
  return chords;
}

double mean_length(const std::vector<Vec3d>& points, const std::vector<std::uint32_t>& corners,
                   const std::vector<HeatChord>& chords) {
  double sum = 0;
  for (std::size_t c = 0; c < corners.size(); c += 3)
    for (std::size_t k = 0; k < 3; ++k) sum += length(points[corners[c + k]] - points[corners[c + (k + 1) % 3]]);
  for (const HeatChord& c : chords) sum += 2 * length(points[c.hi] - points[c.lo]);
  return sum / std::max(1.0, static_cast<double>(corners.size() + 2 * chords.size()));
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
  const std::vector<HeatChord> chords = find_chords(fine, cells, level.corners);
  std::vector<double> mass(level.vertex.size(), 0);
  for (std::size_t v = 0; v < cells.of.size(); ++v) mass[cells.of[v]] += fine.laplacian.mass[v];
  // Of a crumpled surface chords stay short while its cells grow.
  level.spacing = std::max(radius, mean_length(level.points, level.corners, chords));
  level.laplacian =
      make_heat_operator({level.points, level.corners, chords}, std::move(mass), level.spacing, rate_cap);
  return level;
}

bool carries(const HeatLevel& level, double sigma, double error_ratio) {
  return level.points.size() <= kSmallLevel || sigma <= kReach * error_ratio * level.spacing;
}

double seed_radius(double sigma, double error_ratio) { return kSeed * sigma / error_ratio; }

}  // namespace texmesh
