#pragma once

#include "format/base/note.h"
#include "format/documents/quality_table.h"

namespace texmesh {

/// The thesis's statistics of rho = |R_R - R_C| / R_C over the collapses of one scale change (Table 7.1). R_R
/// is the skeleton distance of the removed vertex, R_C that of the vertex that represents it at the coarser
/// scale, chains of collapses included. The divisor is the floored R_eff, because R comes near 0 where the
/// skeleton touches the surface.
struct CollapseStatistics {
  float mean = 0, max = 0, min = 0, deviation = 0, sum = 0;
  float rss = 0;  // root of the sum of squares: it fits the cumulative Table 7.2, which the sum does not
  std::uint32_t collapses = 0;
  static void archive(auto& s, auto& a) { a(s.mean, s.max, s.min, s.deviation, s.sum, s.rss, s.collapses); }
};

/// How much scales differ. rho_ij(p) = dist(p, S_j) / R_eff(p) for points p spread over S_i by area; p95 and
/// p99 are its percentiles. (The thesis's values per collapse shrink with the density of the mesh; a distance
/// between surfaces does not.) An index k counts NestedScales::scales (0 = S_0), not scale numbers.
struct PerceptualValues {
  std::vector<CollapseStatistics> step;  // [k]: the change from k - 1 to k; [0] is all zero
  std::vector<float> p95, p99;           // [i * n + j]: of S_i's points against S_j for j > i; else 0
  // [i * n + j], j > i, else 0: rho over all collapses from S_i to S_j, each against the vertex that is left
  // in S_j.
  std::vector<float> chain_average, chain_largest, chain_least;
  // [k]: 1 = the last scale of its tier. A tier begins behind S_0 or behind the last major scale. It ends
  // before the value against that scale reaches the JND, or with its first scale where that is beyond the JND
  // already.
  std::vector<std::uint8_t> major;
  // [k]: 1 = the package holds the scale: S_0, the major scales, the coarsest one, and the scales nearest to
  // kept_scales equal steps of 2x or more in the number of triangles. Of scales within 1.5x of each other
  // only the finest is kept.
  std::vector<std::uint8_t> kept;
  // Displayed heights never grow with k. kAnyHeightPx stands for S_0 (but for its edges) and for what does
  // not differ from S_0.
  std::vector<float> display_px_edge;   // [k]: O_V / E_S, the height that the scale's edges match, px
  std::vector<float> display_px_error;  // [k]: the height up to which the scale's p95 error is <= 1 px, px
  // [k]: the height D in px up to which the statistic's value against S_0 stays under the change that is just
  // noticeable there, jnd * (jnd_reference_px / D)^exponent. With an exponent of 0: any height or none (0).
  std::vector<float> display_px_jnd;
  float object_height = 0;  // O_V: the longest side of the bounding box, object units
  static void archive(auto& s, auto& a) {
    a(s.step, s.p95, s.p99, s.chain_average, s.chain_largest, s.chain_least, s.major, s.kept,
      s.display_px_edge, s.display_px_error, s.display_px_jnd, s.object_height);
  }
};

/// Per plane and fragment; 0 for fragments without coverage. z, i, zeta, m are raw (8.1-8.3), 0..1:
///   z = mean over the channels of the standard deviation / 127.5, i = mean / 255, m = 1 - (w_I (1 - i) +
///   w_zeta zeta), zeta = share of the pairs of neighbours, east and south, that differ (of 2 (w-1)(h-1)
///   pairs in a whole fragment).
/// Where a fragment is covered in part only its covered texels count, and pairs of them: what fills the rest
/// is never seen. Grey planes count as three equal channels. vqp (8.4) is the weighted mean of eta,
/// z, i and m, each min-max over the covered fragments of the plane (0 where all are equal); eta is S_0's.
struct PlanePredictors {
  std::vector<float> z, i, zeta, m, vqp;
  static void archive(auto& s, auto& a) { a(s.z, s.i, s.zeta, s.m, s.vqp); }
};

struct Predictors {
  std::vector<PlanePredictors> planes;
  double density_weight = 0;  // 0..1: what part of vqp is eta
  static void archive(auto& s, auto& a) { a(s.planes, s.density_weight); }
};

/// What lit pictures say about the kept scales and their textures.
struct MeasuredQuality {
  QualityTable table;
  /// Per QualityTable::scales: ManifestScale::display_px_flip.
  std::vector<float> display_px_flip;
  Notes notes;  // what of the object the pictures do not show
  static void archive(auto& s, auto& a) { a(s.table, s.display_px_flip, s.notes); }
};

}  // namespace texmesh
