#include "stages/ssf/heat_kernel.h"

#include <memory>

#include "stages/base/parallel.h"
#include "stages/geometry/mesh_topology.h"

namespace texmesh {
namespace {

constexpr double kMinCotangent = 0.05, kMaxCotangent = 20, kMassFloor = 0.2;
constexpr double kTruncation = 1e-5, kFineTruncation = 1e-9;
/// ln(1 / kTruncation) with a margin for the sum of the tail: heat_terms() must not be too small.
constexpr double kTruncationLog = 14.5;
/// Terms that one pass over the accumulators takes in. The accumulators are the bulk of the memory traffic.
constexpr int kBlock = 8;
/// Rows of a parallel piece, and of the part of it whose terms stay in the first-level cache.
constexpr std::size_t kHeatGrain = 2048, kRows = 64;

// Four lanes, the last unused: x, y and z of a vertex travel together through every pass over the matrix.
using FloatQuad = float __attribute__((vector_size(16)));
using DoubleQuad = double __attribute__((vector_size(32)));
template <class Real>
struct Lanes;
template <>
struct Lanes<float> {
  using Quad = FloatQuad;
  static constexpr double kRest = kTruncation;
};
template <>
struct Lanes<double> {
  using Quad = DoubleQuad;
  static constexpr double kRest = kFineTruncation;
};

double clamped_cotangent(Vec3d apex, Vec3d a, Vec3d b) {
  const double cosine = dot(a - apex, b - apex), sine = length(cross(a - apex, b - apex));
  if (cosine <= kMinCotangent * sine) return kMinCotangent;
  return cosine >= kMaxCotangent * sine ? kMaxCotangent : cosine / sine;
}

/// Edges of the triangles and chords alike, sorted by both ends.
std::vector<HeatChord> weigh_edges(const HeatSurface& s) {
  const EdgeTable table = group_edges(s.corners, s.points.size());
  std::vector<HeatChord> edges;
  edges.reserve(table.edge_count() + s.chords.size());
  for (std::size_t e = 0; e < table.edge_count(); ++e) {
    const auto halves = table.edge(e);
    const auto [lo, hi] = std::minmax(s.corners[halves[0]], s.corners[next_corner(halves[0])]);
    double weight = 0;
    for (std::uint32_t h : halves)
      weight += 0.5 * clamped_cotangent(s.points[s.corners[previous_corner(h)]], s.points[lo], s.points[hi]);
    edges.push_back({lo, hi, weight});
  }
  const auto middle = static_cast<std::ptrdiff_t>(edges.size());
  edges.insert(edges.end(), s.chords.begin(), s.chords.end());
  std::inplace_merge(
      edges.begin(), edges.begin() + middle, edges.end(),
      [](const HeatChord& a, const HeatChord& b) { return a.lo != b.lo ? a.lo < b.lo : a.hi < b.hi; });
  return edges;
}

std::vector<double> lump_masses(const HeatSurface& s, const std::vector<HeatChord>& edges, double mean_edge) {
  const std::size_t n = s.points.size();
  std::vector<double> mass(n, 0), around(n, 0), degree(n, 0);
  double total = 0;
  for (std::size_t c = 0; c < s.corners.size(); c += 3) {
    const Vec3d a = s.points[s.corners[c]];
    const double third = length(cross(s.points[s.corners[c + 1]] - a, s.points[s.corners[c + 2]] - a)) / 6;
    for (std::size_t k = 0; k < 3; ++k) mass[s.corners[c + k]] += third;
    total += 3 * third;
  }
  for (const HeatChord& e : edges) {
    around[e.lo] += mass[e.hi];
    around[e.hi] += mass[e.lo];
    ++degree[e.lo];
    ++degree[e.hi];
  }
  // The absolute floors are for neighbourhoods, and whole components, of nothing but slivers.
  const double least = 1e-6 * std::max(total / static_cast<double>(n), 1e-6 * mean_edge * mean_edge);
  for (std::size_t i = 0; i < n; ++i)
    mass[i] = std::max({mass[i], kMassFloor * around[i] / std::max(degree[i], 1.0), least});
  return mass;
}

/// Edges are sorted by both ends: first the lower neighbours of every row, then the higher ones, both rising.
void fill_rows(const std::vector<HeatChord>& edges, HeatOperator& l) {
  l.first.assign(l.mass.size() + 1, 0);
  for (const HeatChord& e : edges) {
    ++l.first[e.lo + 1];
    ++l.first[e.hi + 1];
  }
  for (std::size_t i = 0; i < l.mass.size(); ++i) l.first[i + 1] += l.first[i];
  l.column.resize(l.first.back());
  l.rate.resize(l.first.back());
  std::vector<std::uint32_t> at(l.first.begin(), l.first.end() - 1);
  const auto put = [&](std::uint32_t row, std::uint32_t column, double weight) {
    l.column[at[row]] = column;
    l.rate[at[row]++] = static_cast<float>(weight / l.mass[row]);
  };
  for (const HeatChord& e : edges) put(e.hi, e.lo, e.weight);
  for (const HeatChord& e : edges) put(e.lo, e.hi, e.weight);
}

std::vector<double> sums_of_rates(const HeatOperator& l) {
  std::vector<double> leaving(l.mass.size(), 0);
  for (std::size_t i = 0; i < leaving.size(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k) leaving[i] += double{l.rate[k]};
  return leaving;
}

/// L has the nonzero eigenvalues of the edges' matrix B M^-1 B^T W, whose row sums are those of both ends
/// together: never above Gershgorin's bound for L itself.
double bound_spectrum(const HeatOperator& l) {
  const std::vector<double> leaving = sums_of_rates(l);
  double bound = 0;
  for (std::size_t i = 0; i < leaving.size(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k)
      bound = std::max(bound, leaving[i] + leaving[l.column[k]]);
  return bound * (1 + 1e-6);  // the rates are rounded
}

/// exp(-a) I_k(a) for k = 0, 1, ... until it is negligible, by Miller's backward recurrence; the sum over all
/// k (both signs) of I_k(a) is exp(a), so no exponential is needed.
std::vector<double> scaled_bessel(double a) {
  const int start = static_cast<int>(std::ceil(std::sqrt(160 * a))) + 80;
  std::vector<double> value(static_cast<std::size_t>(start) + 1, 0.0);
  double upper = 0, here = 1e-300;
  for (int k = start; k >= 0; --k) {
    value[static_cast<std::size_t>(k)] = here;
    const double lower = upper + (2.0 * k / a) * here;
    upper = here;
    here = lower;
    if (here > 1e250) {
      for (double& v : value) v *= 1e-300;
      upper *= 1e-300;
      here *= 1e-300;
    }
  }
  double sum = 0;
  for (std::size_t k = value.size(); k-- > 1;) sum += 2 * value[k];
  sum += value[0];
  for (double& v : value) v /= sum;
  return value;
}

/// Chebyshev coefficients in y = 1 - 2 lambda / bound of exp(-span lambda) and time lambda exp(-span lambda).
struct Coefficients {
  std::vector<double> smooth, response;
};

Coefficients expand(double span, double time, double bound, double allowed_rest) {
  const std::vector<double> b = scaled_bessel(0.5 * span * bound);
  const double a = 0.5 * time * bound;
  Coefficients c;
  const std::size_t count = b.size() - 1;
  c.smooth.resize(count);
  c.response.resize(count);
  c.smooth[0] = b[0];
  c.response[0] = a * (b[0] - b[1]);
  for (std::size_t k = 1; k < count; ++k) {
    c.smooth[k] = 2 * b[k];
    c.response[k] = a * (2 * b[k] - b[k - 1] - b[k + 1]);
  }
  double rest = 0;
  std::size_t terms = count;
  while (terms > 2) {
    rest += std::max(std::fabs(c.smooth[terms - 1]), std::fabs(c.response[terms - 1]));
    if (rest > allowed_rest) break;
    --terms;
  }
  c.smooth.resize(terms);
  c.response.resize(terms);
  return c;
}

/// The recurrence T_k = 2 A T_{k-1} - T_{k-2}, A = 1 - 2 L / bound, in displacements D_k = T_k x - x. These
/// are as small as the structure that the flow has reached by then, so that single precision loses nothing
/// that the whole object's size would have cost; constants stay exactly zero because rows are summed in
/// differences. The response's series sums to zero on constants, so that it takes the same D_k.
template <class Real>
class Chebyshev {
 public:
  using Quad = typename Lanes<Real>::Quad;

  Chebyshev(const HeatOperator& l, std::span<const Vec3d> points, double start, std::span<const double> times,
            const RunContext& context)
      : l_(l), context_(context), n_(points.size()), flows_(times.size()) {
    for (double t : times) coefficients_.push_back(expand(t - start, t, l.bound, Lanes<Real>::kRest));
    for (HeatFlow& f : flows_) {
      f.moved.resize(n_);
      f.response.resize(n_);
    }
    source_ = std::make_unique<Quad[]>(n_);
    for (auto& t : ring_) t = std::make_unique<Quad[]>(n_);  // zeroed: D_0
    const double factor = 4 / l.bound;
    parallel_each(context_, n_, kHeatGrain, [&](std::size_t i) {
      Vec3d sum;
      for (std::uint32_t e = l.first[i]; e < l.first[i + 1]; ++e)
        sum = sum + (points[i] - points[l.column[e]]) * double{l.rate[e]};
      sum = sum * factor;
      source_[i] = Quad{static_cast<Real>(sum.x), static_cast<Real>(sum.y), static_cast<Real>(sum.z), 0};
    });
  }

  std::vector<HeatFlow> run() {
    const auto terms = static_cast<int>(coefficients_.back().smooth.size());
    for (int k = 0; k < terms; ++k) {
      if (k > 0) step(k);
      if (k % kBlock == kBlock - 1 || k == terms - 1) accumulate(k / kBlock * kBlock, k + 1);
    }
    return std::move(flows_);
  }

 private:
  Quad* term(int k) { return ring_[static_cast<std::size_t>(k % (kBlock + 2))].get(); }

  void step(int k) {
    const Quad* at = term(k - 1);
    const Quad* before = k > 1 ? term(k + kBlock) : nullptr;  // = k - 2 in the ring
    const Quad* source = source_.get();
    const std::uint32_t *first = l_.first.data(), *column = l_.column.data();
    const float* rate = l_.rate.data();
    const auto factor = static_cast<Real>(4 / l_.bound);
    Quad* to = term(k);
    parallel_for(context_, n_, kHeatGrain, [=](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        if (!before) {
          to[i] = source[i] * static_cast<Real>(-0.5);
          continue;
        }
        const Quad here = at[i];
        Quad sum{};
        for (std::uint32_t e = first[i]; e < first[i + 1]; ++e)
          sum += static_cast<Real>(rate[e]) * (here - at[column[e]]);
        to[i] = (here - before[i]) + (here - factor * sum - source[i]);
      }
    });
  }

  void accumulate(int begin_term, int end_term) {
    const std::size_t scales = coefficients_.size();
    std::size_t active = 0;
    while (coefficients_[active].smooth.size() <= static_cast<std::size_t>(begin_term)) ++active;
    // [scale][term][smooth, response]; zero behind a scale's last term
    std::vector<Real> factor(scales * kBlock * 2, 0);
    const Quad* terms[kBlock] = {};
    for (int k = begin_term; k < begin_term + kBlock; ++k)
      terms[k - begin_term] = term(std::min(k, end_term - 1));
    for (std::size_t s = active; s < scales; ++s)
      for (int k = begin_term; k < end_term; ++k)
        if (const auto u = static_cast<std::size_t>(k); u < coefficients_[s].smooth.size()) {
          Real* f = &factor[(s * kBlock + static_cast<std::size_t>(k - begin_term)) * 2];
          f[0] = static_cast<Real>(coefficients_[s].smooth[u]);
          f[1] = static_cast<Real>(coefficients_[s].response[u]);
        }
    parallel_for(context_, n_, kHeatGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t row = begin; row < end; row += kRows)
        for (std::size_t s = active; s < scales; ++s)
          add(terms, &factor[s * kBlock * 2], row, std::min(end, row + kRows), flows_[s]);
    });
  }

  static void add(const Quad* const* terms, const Real* f, std::size_t begin, std::size_t end, HeatFlow& to) {
    for (std::size_t i = begin; i < end; ++i) {
      Quad moved = f[0] * terms[0][i], response = f[1] * terms[0][i];
      for (int k = 1; k < kBlock; ++k) {
        const Quad t = terms[k][i];
        moved += f[2 * k] * t;
        response += f[2 * k + 1] * t;
      }
      Vec3f &m = to.moved[i], &r = to.response[i];
      m = {static_cast<float>(m.x + moved[0]), static_cast<float>(m.y + moved[1]),
           static_cast<float>(m.z + moved[2])};
      r = {static_cast<float>(r.x + response[0]), static_cast<float>(r.y + response[1]),
           static_cast<float>(r.z + response[2])};
    }
  }

  const HeatOperator& l_;
  const RunContext& context_;
  std::size_t n_;
  std::vector<Coefficients> coefficients_;    // per time
  std::unique_ptr<Quad[]> source_;            // (4 / bound) L x
  std::unique_ptr<Quad[]> ring_[kBlock + 2];  // D_k at k % (kBlock + 2)
  std::vector<HeatFlow> flows_;
};

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

HeatOperator make_heat_operator(const HeatSurface& surface, std::vector<double> mass, double mean_edge,
                                double rate_cap) {
  std::vector<HeatChord> edges = weigh_edges(surface);
  HeatOperator l;
  l.mean_edge = mean_edge;
  l.mass = mass.empty() ? lump_masses(surface, edges, mean_edge) : std::move(mass);
  std::size_t capped = 0;
  for (HeatChord& e : edges) {
    const double cap = rate_cap * std::min(l.mass[e.lo], l.mass[e.hi]) / (mean_edge * mean_edge);
    capped += e.weight > cap;
    e.weight = std::min(e.weight, cap);
  }
  fill_rows(edges, l);
  l.bound = bound_spectrum(l);
  l.capped = edges.empty() ? 0 : static_cast<double>(capped) / static_cast<double>(edges.size());
  return l;
}

void limit_spectrum(HeatOperator& l, double bound) {
  std::vector<double> factor = sums_of_rates(l);
  for (double& f : factor) f = f > 0.5 * bound ? 0.5 * bound / f : 1;
  for (std::size_t i = 0; i < factor.size(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k)
      l.rate[k] = static_cast<float>(double{l.rate[k]} * std::min(factor[i], factor[l.column[k]]));
  l.bound = bound_spectrum(l);
}

void trim_spectrum(HeatOperator& l, double share) {
  if (share * static_cast<double>(l.vertex_count()) < 1) return;
  std::vector<double> leaving = sums_of_rates(l);
  const auto rank = static_cast<std::size_t>((1 - share) * static_cast<double>(leaving.size() - 1));
  std::nth_element(leaving.begin(), leaving.begin() + static_cast<std::ptrdiff_t>(rank), leaving.end());
  const double bound = 2 * leaving[rank];
  if (bound > 0 && bound < l.bound) limit_spectrum(l, bound);
}

int heat_terms(double time, double bound) {
  return static_cast<int>(std::ceil(std::sqrt(kTruncationLog * time * bound) + kTruncationLog));
}

std::vector<HeatFlow> diffuse(const HeatOperator& laplacian, std::span<const Vec3d> points, double start,
                              std::span<const double> times, const RunContext& context,
                              HeatPrecision precision) {
  if (times.empty()) return {};
  if (precision == HeatPrecision::kDouble)
    return Chebyshev<double>(laplacian, points, start, times, context).run();
  return Chebyshev<float>(laplacian, points, start, times, context).run();
}

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
