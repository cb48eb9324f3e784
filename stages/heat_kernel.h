#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/vec.h"
#include "stages/run_context.h"

namespace texmesh {

/// The Laplace-Beltrami operator of a triangle mesh, positive semi-definite: (L f)_i = sum_j rate_ij (f_i -
/// f_j).
struct HeatOperator {
  std::vector<std::uint32_t> first;   // [vertices + 1] into column and rate
  std::vector<std::uint32_t> column;  // neighbours, rising within a row
  std::vector<double> rate;           // w_ij / M_i, one over length squared
  double bound = 0;                   // no eigenvalue is larger: max over edges of both ends' row sums
  double capped = 0;                  // fraction of edges whose weight the rate cap lowered
  std::size_t vertex_count() const { return first.size() - 1; }
};

/// Cotangent weights, each cotangent clamped to [0.05, 20]; barycentric lumped masses of at least 0.2 of the
/// neighbours' mean; w_ij <= rate_cap min(M_i, M_j) / mean_edge^2, which keeps slivers and uneven sampling
/// from blowing up the spectrum. `corners`: three vertices per triangle, all
/// different, every vertex in use. Works for triangles without area.
HeatOperator make_heat_operator(std::span<const Vec3d> points, std::span<const std::uint32_t> corners,
                                double mean_edge, double rate_cap);

/// What heat flow for each of several times t makes of the points.
struct HeatFlow {
  struct Value {
    Vec3f smooth;    // exp(-tL) x
    Vec3f response;  // t L exp(-tL) x: the (negative) scale-normalised Laplacian of Gaussian
  };
  std::size_t times = 0;
  std::vector<Value> values;  // [vertex * times + time]
  const Value& at(std::size_t vertex, std::size_t time) const { return values[vertex * times + time]; }
};

/// How many Chebyshev terms a time needs at least, and the longest time that `terms` suffice for.
int heat_terms(double time, double bound);
double heat_time(int terms, double bound);

/// Both kernels for all (strictly rising, positive) times in one Chebyshev recurrence, each truncated where
/// the rest is below 1e-5. Deterministic for any thread count.
HeatFlow diffuse(const HeatOperator& laplacian, std::span<const Vec3d> points, std::span<const double> times,
                 const RunContext& context);

}  // namespace texmesh
