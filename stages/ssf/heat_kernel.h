#pragma once
#include <span>
#include <vector>

#include "format/base/vec.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// The Laplace-Beltrami operator L of a surface: (L f)_i = sum_j rate_ij (f_i - f_j). L is positive
/// semi-definite. The matrix is sparse and stored by rows.
struct HeatOperator {
  std::vector<std::uint32_t> first;   // [vertices + 1]: where the row of a vertex begins in column and rate
  std::vector<std::uint32_t> column;  // neighbours of the vertex, rising within a row
  std::vector<float> rate;            // rate_ij = w_ij / M_i, in 1 / length^2
  std::vector<double> mass;           // M_i: the vertex's share of the area
  double mean_edge = 0;               // mean length of an edge that make_heat_operator() was given
  double bound = 0;   // bound of the eigenvalues: most, over edges, of both ends' sums of rates
  double capped = 0;  // fraction of edges whose weight the rate cap has lowered
  std::size_t vertex_count() const { return first.size() - 1; }
};

/// Two vertices that are neighbours without an edge of a triangle between them, and their weight.
struct HeatChord {
  std::uint32_t lo = 0, hi = 0;  // lo < hi
  double weight = 0;             // > 0
};

/// The surface of an operator. Every vertex has a triangle or a chord. Triangles may have no area.
struct HeatSurface {
  std::span<const Vec3d> points;
  std::span<const std::uint32_t> corners;  // three different vertices for each triangle
  std::span<const HeatChord> chords;       // sorted by lo, then hi; no chord is an edge of a triangle
};

/// Makes the operator from cotangent weights. Each cotangent is clamped to [0.05, 20]. Each weight w_ij is at
/// most rate_cap min(M_i, M_j) / mean_edge^2, so that slivers and uneven sampling give no huge eigenvalues.
/// When `mass` is empty, the masses are barycentric: a third of the area of a vertex's triangles, and at
/// least 0.2 of the mean of its neighbours.
HeatOperator make_heat_operator(const HeatSurface& surface, std::vector<double> mass, double mean_edge,
                                double rate_cap);

/// Lowers the rates of the edges of every vertex whose rates sum up to more than half of `bound`. Afterwards
/// no eigenvalue is larger than `bound`.
void limit_spectrum(HeatOperator& laplacian, double bound);

/// Slows down the vertices whose rates sum up to most, `share` of all, rounded up, to what the others have at
/// most; of so few vertices that it is less than one of them, none. A handful of them set the bound of the
/// spectrum, and heat through them is even long before it has gone anywhere.
void trim_spectrum(HeatOperator& laplacian, double share);

/// The points x after heat flow until time t, as displacements. A place as a float would have too few digits
/// for the response of fine relief on a large surface.
struct HeatFlow {
  std::vector<Vec3f> moved;     // exp(-(t - start) L) x - x
  std::vector<Vec3f> response;  // t L exp(-(t - start) L) x: the negative of the scale-normalised LoG
};

enum class HeatPrecision : std::uint8_t {
  kFloat,   // single precision; the series ends where the rest is below 1e-5
  kDouble,  // double precision; the series ends where the rest is below 1e-9. Tests compare with it
};

/// The most Chebyshev terms that heat flow over the time span `time` needs. `bound`: HeatOperator::bound.
int heat_terms(double time, double bound);

/// Runs heat flow from `start` to each of `times` and returns one HeatFlow for each time. `times` rise
/// strictly and are larger than `start`. `points` are the points x at time `start`. A long flow can be run
/// in parts: exp(-(a + b) L) = exp(-b L) exp(-a L).
/// One Chebyshev recurrence serves both members of HeatFlow and all times. Each of its matrix products takes
/// x, y and z together. The response is not made from the smoothed points: its kernel,
/// t lambda exp(-t lambda), is expanded directly.
/// Equal input gives equal results for any number of threads. Throws Cancelled.
std::vector<HeatFlow> diffuse(const HeatOperator& laplacian, std::span<const Vec3d> points, double start,
                              std::span<const double> times, const RunContext& context,
                              HeatPrecision precision = HeatPrecision::kFloat);

/// A surface at one level of detail, fine enough for heat that has already flowed further than its spacing.
struct HeatLevel {
  std::vector<std::uint32_t> vertex;   // per vertex: its vertex on the level that this one was made from
  std::vector<Vec3d> points;           // of the original surface
  std::vector<std::uint32_t> corners;  // three vertices per triangle; on coarse levels a vertex may have none
  double spacing = 0;                  // of the vertices, about
  HeatOperator laplacian;
};

/// The level that has every vertex.
HeatLevel finest_level(std::vector<Vec3d> points, std::vector<std::uint32_t> corners, double spacing,
                       double rate_cap);

/// The next coarser level.
/// - Seeds: the vertices in order, each unless a seed is within `radius` along the edges. Every vertex joins
///   its nearest seed (Voronoi cells by Dijkstra); ties go to the earlier seed.
/// - Seeds are the new vertices, and the areas of their cells the masses. Between cells that touch the same
///   heat passes as through the fine edges between them under a constant gradient.
/// - Fine triangles of three cells become the new triangles, one per three cells and direction; only normals
///   need them.
/// Deterministic. O(n log n).
HeatLevel coarsen(const HeatLevel& fine, double radius, double rate_cap);

/// Whether the level is still the right one for heat that has flowed as far as sigma: up to 2.4 error_ratio
/// spacings the level is nearer to the truth than the next coarser one. Levels of few vertices carry
/// everything.
bool carries(const HeatLevel& level, double sigma, double error_ratio);
/// The radius to coarsen by, for a level whose first sigma is `sigma`.
double seed_radius(double sigma, double error_ratio);
/// The largest sigma of the state from which a level with this first sigma should start. Points that another
/// operator smoothed are rough at first under the level's operator; by `first_sigma` the roughness is gone.
double handover_sigma(double first_sigma);

}  // namespace texmesh
