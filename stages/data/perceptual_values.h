#pragma once
#include <cstdint>
#include <vector>

namespace texmesh {

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

}  // namespace texmesh
