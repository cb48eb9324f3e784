#pragma once

#include "stages/data/conditioned_mesh.h"
#include "stages/data/scale_map.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kSsfVersion = 6;

/// What meshes are filtered by: the curvature of positions, or R(v) as the thesis has it (7.2).
enum class ScaleSignal : std::uint8_t { kCurvature, kRadius };
template <>
struct EnumNames<ScaleSignal> {
  static constexpr std::array<std::string_view, 2> names{"curvature", "radius"};
};
/// Where phi and psi of (2.4) are taken in a range scan: of the scan's mean radius, or of each row's.
enum class RangeSpacing : std::uint8_t { kMean, kRow };
template <>
struct EnumNames<RangeSpacing> {
  static constexpr std::array<std::string_view, 2> names{"mean", "row"};
};

struct SsfOptions {
  int scales = 20;
  ScaleSignal signal = ScaleSignal::kCurvature;
  RangeSpacing range_spacing = RangeSpacing::kMean;
  double sigma_max = 0.15;
  double convergence = 0.3;                // eps_conv
  static constexpr double band = 2.75;     // C_i = t_i (H(sigma_i) - H(band * sigma_i))
  static constexpr double contrast = 0.3;  // tau
  static constexpr double component_cap = 0.25;
  double rate_cap = 10;    // w_ij <= cap * min(M_i, M_j) / h^2
  double error_ratio = 5;  // more is nearer to the full resolution, and slower
  int max_terms = 3000;
  double window = 1.4;    // range scans: half-width of the Gaussian, in sigma; no option: a test compares it
                          // with a wider one
  double range_band = 0;  // the thesis has the Laplacian of Gaussian alone
  static void fields(auto& s, auto&& v) {
    v("scales", s.scales, Range{1, 40}, "smoothed copies beside the original");
    v("signal", s.signal, ProfileOnly{},
      "meshes: curvature = band-passed mean curvature; radius = R(v), the distance to the skeleton, whose "
      "Laplacian of Gaussian has its zero crossings marked, as the thesis has it");
    v("range_spacing", s.range_spacing, ProfileOnly{},
      "range scans: phi and psi by the mean radius of the scan, or of each row");
    v("sigma_max", s.sigma_max, Range{0.01, 0.5}, ProfileOnly{},
      "largest sigma, as a fraction of a component's diagonal");
    v("convergence", s.convergence, Range{0, 1}, ProfileOnly{},
      "sigma stops growing where the signal's range falls below this fraction");
    v("rate_cap", s.rate_cap, Range{3, 1000}, ProfileOnly{},
      "cap of the Laplacian's rates, in 1 / (mean edge)^2");
    v("error_ratio", s.error_ratio, Range{2, 1000}, ProfileOnly{},
      "least ratio of sigma and vertex spacing on the coarser levels of the solver; 1000 = one level");
    v("max_terms", s.max_terms, Range{100, 100000}, ProfileOnly{},
      "most Chebyshev terms of a level; the level's fastest rates are slowed down to fit");
    v("range_band", s.range_band, Range{0, 6}, ProfileOnly{},
      "range scans: the same ratio as band; at most 1 = the Laplacian of Gaussian alone");
  }
};

/// Scale-space filtering of a mesh: the band-passed mean curvature on the heat kernel, of the positions that
/// the heat flow smooths. It runs over the position graph, in which twins are one.
/// - Every component has a sigma ladder of its own. It begins at the component's mean edge, and ends at
///   sigma_max of its diagonal or at the first sigma at which the smoothed component has shrunk to
///   `convergence` of its extent.
/// - Small parts are detail of the whole: a scale counts for a component only while its sigma, there and on
///   the largest component (most positions), is within component_cap of the component's diagonal.
/// - Large sigmas are solved on coarser levels, whose vertices are positions of the mesh. Feature points of a
///   scale are there no closer to one another than feature_spacing().
/// - The fastest 50th of a level's vertices has the rates of the others: trim_spectrum() of heat_kernel.h.
/// O(n log n). Deterministic for any thread count.
ScaleMap filter_scale_space(const ConditionedMesh& mesh, const SsfOptions& options,
                            const RunContext& context);

/// The same of R(v) (thesis 7.2): the Laplacian of Gaussian of the distance to the skeleton. Feature points
/// are its zero crossings alone, without a contrast rule beyond rounding: persistence equals crossing, and
/// nothing is subtracted. phi and psi (2.4) are those of every place: the Laplacian is that of the mesh's own
/// metric. A component converges where the range of R has. StageError when the skeleton is of another mesh.
ScaleMap filter_skeleton_distance(const ConditionedMesh& mesh, const Skeleton& skeleton,
                                  const SsfOptions& options, const RunContext& context);

/// The distance that feature points of a scale keep from one another on the coarser levels: 0.8 sigma /
/// error_ratio, in the unit of sigma.
double feature_spacing(double sigma, const SsfOptions& options);

/// The grid of a range scan with positions of the conditioned mesh in place of those of the mesh before,
/// which had `source_positions`. Where a position has several copies, a sample goes to the first one; where
/// condition dropped it, the sample has none (kNoIndex). Throws StageError for an index out of range.
RangeGrid grid_on_conditioned(const RangeGrid& grid, std::size_t source_positions,
                              const ConditionedMesh& mesh);

/// Faithful filtering of a cylindrical range scan (thesis 2.2-2.4): separable Gaussian and LoG on r(alpha,
/// y), periodic in alpha when the grid is a full turn, windows cut off at `window` sigma.
/// - Sigma is a length on the surface, so that unequal spacing along alpha and y counts (phi, psi), see
///   SsfOptions::range_spacing. It runs
///   from the mean spacing to sigma_max of the object's diagonal, or to the first sigma at which max - min of
///   the smoothed radius falls below `convergence` of S_0's.
/// - Feature points are zero crossings alone and have no contrast rule: persistence equals crossing.
/// - Samples that are missing take no part.
/// - The two filters differ by default: a Gaussian cut off at 1.4 sigma is one of 0.71 sigma, and a LoG keeps
///   the base shape's curvature, which the mesh's signal has not. On equal terms (window >= 3, range_band =
///   band) both mark the same places up to sigmas of a fifth of the radius, where heat begins to round the
///   cross-section.
/// `position_count` sizes the maps; positions without a sample get 0. StageError for a grid whose arrays or
/// steps are wrong. Deterministic for any thread count.
ScaleMap filter_range_scan(const RangeGrid& range, std::size_t position_count, const SsfOptions& options,
                           const RunContext& context);

}  // namespace texmesh
