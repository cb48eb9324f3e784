#include "stages/heat_kernel.h"

#include <algorithm>
#include <cmath>

#include "stages/mesh_topology.h"
#include "stages/parallel.h"

namespace texmesh {
namespace {

constexpr double kMinCotangent = 0.05, kMaxCotangent = 20, kMassFloor = 0.2;
constexpr double kTruncation = 1e-5;
/// ln(1 / kTruncation) with a margin for the sum of the tail: heat_terms() must not be too small.
constexpr double kTruncationLog = 14.5;
/// Terms that one pass over the accumulators takes in. The accumulators are the bulk of the memory traffic.
constexpr int kBlock = 8;
constexpr std::size_t kGrain = 1024;

// Four lanes, the last unused: x, y and z of a vertex travel together through every pass over the matrix.
using Real = double;
using Quad = Real __attribute__((vector_size(4 * sizeof(Real))));

double clamped_cotangent(Vec3d apex, Vec3d a, Vec3d b) {
  const double cosine = dot(a - apex, b - apex), sine = length(cross(a - apex, b - apex));
  if (cosine <= kMinCotangent * sine) return kMinCotangent;
  return cosine >= kMaxCotangent * sine ? kMaxCotangent : cosine / sine;
}

struct Edges {
  std::vector<std::uint32_t> lo, hi;
  std::vector<double> weight;
};

Edges weigh_edges(std::span<const Vec3d> points, std::span<const std::uint32_t> corners) {
  const EdgeTable table = group_edges(corners, points.size());
  Edges edges;
  for (std::size_t e = 0; e < table.edge_count(); ++e) {
    const auto halves = table.edge(e);
    const auto [lo, hi] = std::minmax(corners[halves[0]], corners[next_corner(halves[0])]);
    double weight = 0;
    for (std::uint32_t h : halves)
      weight += 0.5 * clamped_cotangent(points[corners[previous_corner(h)]], points[lo], points[hi]);
    edges.lo.push_back(lo);
    edges.hi.push_back(hi);
    edges.weight.push_back(weight);
  }
  return edges;
}

std::vector<double> lump_masses(std::span<const Vec3d> points, std::span<const std::uint32_t> corners,
                                const Edges& edges) {
  const std::size_t n = points.size();
  std::vector<double> mass(n, 0), around(n, 0), degree(n, 0);
  double total = 0;
  for (std::size_t c = 0; c < corners.size(); c += 3) {
    const Vec3d a = points[corners[c]];
    const double third = length(cross(points[corners[c + 1]] - a, points[corners[c + 2]] - a)) / 6;
    for (std::size_t k = 0; k < 3; ++k) mass[corners[c + k]] += third;
    total += 3 * third;
  }
  for (std::size_t e = 0; e < edges.lo.size(); ++e) {
    around[edges.lo[e]] += mass[edges.hi[e]];
    around[edges.hi[e]] += mass[edges.lo[e]];
    ++degree[edges.lo[e]];
    ++degree[edges.hi[e]];
  }
  // The absolute floor is for neighbourhoods of nothing but slivers.
  const double least = 1e-6 * total / static_cast<double>(n);
  for (std::size_t i = 0; i < n; ++i)
    mass[i] = std::max({mass[i], kMassFloor * around[i] / std::max(degree[i], 1.0), least});
  return mass;
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

/// Chebyshev coefficients in y = 1 - 2 lambda / bound of exp(-t lambda) and t lambda exp(-t lambda).
struct Coefficients {
  std::vector<double> smooth, response;
};

Coefficients expand(double time, double bound) {
  const double a = 0.5 * time * bound;
  const std::vector<double> b = scaled_bessel(a);
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
    if (rest > kTruncation) break;
    --terms;
  }
  c.smooth.resize(terms);
  c.response.resize(terms);
  return c;
}

class Chebyshev {
 public:
  Chebyshev(const HeatOperator& l, std::span<const Vec3d> points, std::span<const double> times,
            const RunContext& context)
      : l_(l), context_(context), n_(points.size()) {
    for (double t : times) coefficients_.push_back(expand(t, l.bound));
    scale_.resize(l.rate.size());
    for (std::size_t i = 0; i < scale_.size(); ++i) scale_[i] = static_cast<Real>(4 / l.bound * l.rate[i]);
    diagonal_.assign(n_, 2);
    for (std::size_t i = 0; i < n_; ++i)
      for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k) diagonal_[i] -= 4 / l.bound * l.rate[k];
    flow_.times = times.size();
    flow_.values.resize(n_ * times.size());
    for (auto& t : ring_) t.assign(n_, Quad{});
    for (std::size_t i = 0; i < n_; ++i)
      ring_[0][i] = Quad{static_cast<Real>(points[i].x), static_cast<Real>(points[i].y),
                         static_cast<Real>(points[i].z), 0};
  }

  HeatFlow run() {
    const auto terms = static_cast<int>(coefficients_.back().smooth.size());
    for (int k = 0; k < terms; ++k) {
      if (k > 0) step(k);
      if (k % kBlock == kBlock - 1 || k == terms - 1) accumulate(k / kBlock * kBlock, k + 1);
    }
    return std::move(flow_);
  }

 private:
  std::vector<Quad>& term(int k) { return ring_[static_cast<std::size_t>(k % (kBlock + 2))]; }

  /// T_k = 2 A T_{k-1} - T_{k-2} with A = 1 - 2 L / bound; T_1 = A T_0.
  void step(int k) {
    const Quad* at = term(k - 1).data();
    const Quad* before = k > 1 ? term(k + kBlock).data() : nullptr;  // = k - 2 in the ring
    Quad* to = term(k).data();
    parallel_for(context_, n_, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Quad sum = static_cast<Real>(diagonal_[i]) * at[i];
        for (std::uint32_t e = l_.first[i]; e < l_.first[i + 1]; ++e) sum += scale_[e] * at[l_.column[e]];
        to[i] = before ? sum - before[i] : sum * static_cast<Real>(0.5);
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
      terms[k - begin_term] = term(std::min(k, end_term - 1)).data();
    for (std::size_t s = active; s < scales; ++s)
      for (int k = begin_term; k < end_term; ++k)
        if (const auto u = static_cast<std::size_t>(k); u < coefficients_[s].smooth.size()) {
          Real* f = &factor[(s * kBlock + static_cast<std::size_t>(k - begin_term)) * 2];
          f[0] = static_cast<Real>(coefficients_[s].smooth[u]);
          f[1] = static_cast<Real>(coefficients_[s].response[u]);
        }
    parallel_for(context_, n_, kGrain, [&](std::size_t begin, std::size_t end) {
      for (std::size_t i = begin; i < end; ++i) {
        Quad t[kBlock];
        for (int k = 0; k < kBlock; ++k) t[k] = terms[k][i];
        for (std::size_t s = active; s < scales; ++s) {
          const Real* f = &factor[s * kBlock * 2];
          Quad smooth = f[0] * t[0], response = f[1] * t[0];
          for (int k = 1; k < kBlock; ++k) {
            smooth += f[2 * k] * t[k];
            response += f[2 * k + 1] * t[k];
          }
          HeatFlow::Value& to = flow_.values[i * scales + s];
          to.smooth = to.smooth + to_float(Vec3d{smooth[0], smooth[1], smooth[2]});
          to.response = to.response + to_float(Vec3d{response[0], response[1], response[2]});
        }
      }
    });
  }

  const HeatOperator& l_;
  const RunContext& context_;
  std::size_t n_;
  std::vector<Coefficients> coefficients_;  // per time
  std::vector<Real> scale_;                 // 4 rate / bound
  std::vector<double> diagonal_;
  std::vector<Quad> ring_[kBlock + 2];  // T_k at k % (kBlock + 2)
  HeatFlow flow_;
};

}  // namespace

HeatOperator make_heat_operator(std::span<const Vec3d> points, std::span<const std::uint32_t> corners,
                                double mean_edge, double rate_cap) {
  Edges edges = weigh_edges(points, corners);
  const std::vector<double> mass = lump_masses(points, corners, edges);
  std::size_t capped = 0;
  HeatOperator l;
  l.first.assign(points.size() + 1, 0);
  for (std::size_t e = 0; e < edges.lo.size(); ++e) {
    const double cap = rate_cap * std::min(mass[edges.lo[e]], mass[edges.hi[e]]) / (mean_edge * mean_edge);
    capped += edges.weight[e] > cap;
    edges.weight[e] = std::min(edges.weight[e], cap);
    ++l.first[edges.lo[e] + 1];
    ++l.first[edges.hi[e] + 1];
  }
  for (std::size_t i = 0; i < points.size(); ++i) l.first[i + 1] += l.first[i];
  l.column.resize(l.first.back());
  l.rate.resize(l.first.back());
  // Edges are sorted by both ends: first the lower neighbours of every row, then the higher ones, both
  // rising.
  std::vector<std::uint32_t> at(l.first.begin(), l.first.end() - 1);
  const auto put = [&](std::uint32_t row, std::uint32_t column, double weight) {
    l.column[at[row]] = column;
    l.rate[at[row]++] = weight / mass[row];
  };
  for (std::size_t e = 0; e < edges.lo.size(); ++e) put(edges.hi[e], edges.lo[e], edges.weight[e]);
  for (std::size_t e = 0; e < edges.lo.size(); ++e) put(edges.lo[e], edges.hi[e], edges.weight[e]);
  std::vector<double> leaving(points.size(), 0);
  for (std::size_t i = 0; i < points.size(); ++i) {
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k) leaving[i] += l.rate[k];
  }
  // L has the nonzero eigenvalues of the edges' matrix B M^-1 B^T W, whose row sums are those of both ends
  // together: never above Gershgorin's bound for L itself.
  for (std::size_t i = 0; i < points.size(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k)
      l.bound = std::max(l.bound, leaving[i] + leaving[l.column[k]]);
  l.capped = edges.lo.empty() ? 0 : static_cast<double>(capped) / static_cast<double>(edges.lo.size());
  return l;
}

int heat_terms(double time, double bound) {
  return static_cast<int>(std::ceil(std::sqrt(kTruncationLog * time * bound) + kTruncationLog));
}

double heat_time(int terms, double bound) {
  const double root = std::max(1.0, terms - kTruncationLog);
  return root * root / (kTruncationLog * bound);
}

HeatFlow diffuse(const HeatOperator& laplacian, std::span<const Vec3d> points, std::span<const double> times,
                 const RunContext& context) {
  return Chebyshev(laplacian, points, times, context).run();
}

}  // namespace texmesh
