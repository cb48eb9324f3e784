#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "format/base/vec.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// The Laplace-Beltrami operator of a surface, positive semi-definite: (L f)_i = sum_j rate_ij (f_i - f_j).
struct HeatOperator {
  std::vector<std::uint32_t> first;   // [vertices + 1] into column and rate
  std::vector<std::uint32_t> column;  // neighbours, rising within a row
  std::vector<float> rate;            // w_ij / M_i, one over length squared
  std::vector<double> mass;           // M_i: the share of the area
  double mean_edge = 0;               // as it was made with
  double bound = 0;                   // no eigenvalue is larger: max over edges of both ends' row sums
  double capped = 0;                  // fraction of edges whose weight the rate cap lowered
  std::size_t vertex_count() const { return first.size() - 1; }
};

/// Neighbours whose weight no triangle gives.
struct HeatChord {
  std::uint32_t lo = 0, hi = 0;  // lo < hi
  double weight = 0;             // > 0
};

/// What the operator is made from: points, and three vertices per triangle, all different; every vertex has a
/// triangle or a chord. Works for triangles without area.
struct HeatSurface {
  std::span<const Vec3d> points;
  std::span<const std::uint32_t> corners;
  std::span<const HeatChord> chords;  // sorted by lo, hi; none is an edge of a triangle
};

/// Cotangent weights, each cotangent clamped to [0.05, 20]; w_ij <= rate_cap min(M_i, M_j) / mean_edge^2,
/// which keeps slivers and uneven sampling from blowing up the spectrum. An empty `mass` stands for the
/// barycentric lumped ones, of at least 0.2 of the neighbours' mean.
HeatOperator make_heat_operator(const HeatSurface& surface, std::vector<double> mass, double mean_edge,
                                double rate_cap);

/// Slows down the edges of vertices whose rates sum up to more than half of `bound`, so that no eigenvalue is
/// larger.
void limit_spectrum(HeatOperator& laplacian, double bound);

/// What heat flow makes of points x by one time t. Displacements, not places: beside the size of the whole a
/// float has too few digits for the response of fine relief.
struct HeatFlow {
  std::vector<Vec3f> moved;     // exp(-(t - start) L) x - x
  std::vector<Vec3f> response;  // t L exp(-(t - start) L) x: the (negative) scale-normalised LoG
};

enum class HeatPrecision : std::uint8_t {
  kFloat,   // single precision, series truncated where the rest is below 1e-5
  kDouble,  // double precision, 1e-9: the yardstick
};

/// How many Chebyshev terms heat flow over this much time needs at most.
int heat_terms(double time, double bound);

/// Both kernels for all times (strictly rising, beyond `start`) in one Chebyshev recurrence whose matrix
/// passes take x, y and z together. `points` are x at time `start`; flows follow one another exp(-(a+b)L) =
/// exp(-bL) exp(-aL), so that long ones can be run in parts. t lambda exp(-t lambda) is expanded directly,
/// not made from the smoothed points. Deterministic for any thread count.
std::vector<HeatFlow> diffuse(const HeatOperator& laplacian, std::span<const Vec3d> points, double start,
                              std::span<const double> times, const RunContext& context,
                              HeatPrecision precision = HeatPrecision::kFloat);

/// Bytes that one term of the single-precision recurrence has to move at least: operator and vectors once
/// each.
double heat_term_bytes(const HeatOperator& laplacian);

}  // namespace texmesh
