#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "format/base/fields.h"
#include "stages/base/run_context.h"
#include "stages/simplification/simplification.h"
#include "stages/skeletonization/skeletonization.h"

namespace texmesh {

inline constexpr int kPerceptualValuesVersion = 3;

/// Which table decides what is just noticeable. kP95 and kP99: the relative distance between two scales. The
/// others are the thesis's strategies (7.2) over the collapses of a scale change, accumulated (Table 7.2):
/// average, conservative = the largest change, aggressive = the smallest one.
enum class PerceptualStatistic : std::uint8_t { kP95, kP99, kAverage, kConservative, kAggressive };
template <>
struct EnumNames<PerceptualStatistic> {
  static constexpr std::array<std::string_view, 5> names{"p95", "p99", "average", "conservative",
                                                         "aggressive"};
};

/// Displayed height in px at which judges' JND holds by default: the thesis's stimuli stood side by side on
/// monitors of 1024..1280 px (Table 7.3; Fig. 7.14 speaks of 90..170 px from skeleton to surface).
inline constexpr double kJndReferencePx = 512;

struct PerceptualValuesOptions {
  double jnd = 0.10;                          // just-noticeable relative change of the skeleton distance
  double jnd_reference_px = kJndReferencePx;  // displayed height at which that JND was found
  PerceptualStatistic statistic = PerceptualStatistic::kP95;
  int samples = 4000;   // points compared per pair of scales: the percentiles' ranks are within 0.5 % then
  int kept_scales = 8;  // about how many scales a package holds beside S_0 and the major ones
  double edge_percentile = 5;  // E_S of the O_V / E_S rule: this percentile of the edge lengths; 0 = shortest
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("jnd", s.jnd, Range{0.001, 1}, "just-noticeable relative change of the distance to the skeleton");
    v("jnd_reference_px", s.jnd_reference_px, Range{1, 100000},
      "displayed height of the object in px at which that difference is just noticeable");
    v("statistic", s.statistic,
      "what decides about major scales: p95 of the relative distance, p99 for close views, or the thesis's "
      "average, conservative (largest) and aggressive (smallest) change of the skeleton distance");
    v("samples", s.samples, Range{100, 1000000}, "points compared per pair of scales");
    v("kept_scales", s.kept_scales, Range{1, 40},
      "scales a package holds, about; steps of about 2x between them");
    v("edge_percentile", s.edge_percentile, Range{0, 50},
      "percentile of the edge lengths that counts as shortest edge");
  }
};

/// Stands for "any displayed height" where a scale does not differ from S_0.
inline constexpr float kAnyHeightPx = 1e9f;

/// The thesis's statistics of rho = |R_R - R_C| / R_C over the collapses of one scale change (Table 7.1). R_R
/// and R_C are skeleton distances of the removed vertex and of the one that represents it at the coarser
/// scale (chains included); the divisor is the floored R_eff, because R comes near 0 where the skeleton
/// touches the surface. rss = root of the sum of squares, which fits the cumulative Table 7.2 where the sum
/// does not.
struct CollapseStatistics {
  float mean = 0, max = 0, min = 0, deviation = 0, sum = 0, rss = 0;
  std::uint32_t collapses = 0;
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.mean, s.max, s.min, s.deviation, s.sum, s.rss, s.collapses);
  }
};

/// rho_ij(p) = dist(p, S_j) / R_eff(p) for points p spread over S_i by area; p95 and p99 are its percentiles.
/// (The thesis's per-collapse values shrink with the density of the mesh; a distance between surfaces does
/// not.) Index k below counts NestedScales::scales (0 = S_0), not scale numbers.
struct PerceptualValues {
  std::vector<CollapseStatistics> step;  // [k]: change from k-1 to k; [0] all zero
  std::vector<float> p95, p99;  // [i * n + j], j > i: relative distance of S_i's points to S_j; else 0
  std::vector<std::uint8_t>
      major;  // [k]: 1 = last of its tier: walking from S_0 or the last major, the last scale
              // before the value reaches the JND, or the next one where none is under it
  std::vector<std::uint8_t> kept;  // [k]: 1 = stored in the package: S_0, majors, the coarsest, and the
                                   // scales nearest to kept_scales equal steps of the triangles' number, of
                                   // 2x or more; of those within 1.5x of each other only the finest
  // Displayed heights never grow with k; kAnyHeightPx for S_0 (edges excepted) and for what does not differ
  // from it.
  std::vector<float>
      display_px_edge;  // [k]: O_V / E_S, the displayed height in px that the scale's edges match
  std::vector<float>
      display_px_error;  // [k]: displayed height in px up to which the scale's p95 error is <= 1 px
  // [k]: displayed height in px up to which the statistic's value against S_0 stays under the JND of that
  // height. A change of the surface subtends more when the object is shown larger, so the relative change
  // that is just noticeable at D px is taken as jnd * jnd_reference_px / D.
  std::vector<float> display_px_jnd;
  float object_height = 0;  // O_V: largest extent of the bounding box, object units
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.step, s.p95, s.p99, s.major, s.kept, s.display_px_edge, s.display_px_error, s.display_px_jnd,
      s.object_height);
  }
};

/// Table 7.2 from Table 7.1: [i * n + j], j > i: the change from scale i to scale j as the root of the sum of
/// the squared changes of the steps between (the thesis prints 0.041 .. 0.108 where this gives 0.041 ..
/// 0.112; the plain sum would be 0.245). `strategy` is one of the thesis's; StageError for a percentile.
std::vector<float> cumulative_table(const std::vector<CollapseStatistics>& step,
                                    PerceptualStatistic strategy);

/// The table of n x n values that `statistic` decides by.
std::vector<float> value_table(const PerceptualValues& values, PerceptualStatistic statistic);

/// Throws StageError when the skeleton is of another mesh. Same bytes for any thread count.
PerceptualValues measure_perceptual_values(const NestedScales& scales, const Skeleton& skeleton,
                                           const PerceptualValuesOptions& options, const RunContext& context);

}  // namespace texmesh
