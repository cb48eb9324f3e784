#pragma once
#include <cstdint>
#include <string_view>
#include <vector>

#include "format/fields.h"
#include "stages/run_context.h"
#include "stages/simplification.h"
#include "stages/skeletonization.h"

namespace texmesh {

inline constexpr int kPerceptualValuesVersion = 1;

enum class PerceptualStatistic : std::uint8_t { kP95, kP99 };
template <>
struct EnumNames<PerceptualStatistic> {
  static constexpr std::array<std::string_view, 2> names{"p95", "p99"};
};

struct PerceptualValuesOptions {
  double jnd = 0.10;  // just-noticeable relative change of the skeleton distance
  PerceptualStatistic statistic = PerceptualStatistic::kP95;
  int samples = 20000;         // points compared per pair of scales
  int kept_scales = 8;         // about how many scales a package holds beside S_0 and the major ones
  double edge_percentile = 5;  // E_S of the O_V / E_S rule: this percentile of the edge lengths; 0 = shortest
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("jnd", s.jnd, Range{0.001, 1}, "just-noticeable relative change of the distance to the skeleton");
    v("statistic", s.statistic, "which percentile of the relative change decides: p95, or p99 for close views");
    v("samples", s.samples, Range{100, 1000000}, "points compared per pair of scales");
    v("kept_scales", s.kept_scales, Range{1, 40}, "scales a package holds, about; steps of about 2x between them");
    v("edge_percentile", s.edge_percentile, Range{0, 50}, "percentile of the edge lengths that counts as shortest edge");
  }
};

/// The thesis's statistics of rho = |R_R - R_C| / R_C over the collapses of one scale change (Table 7.1).
struct CollapseStatistics {
  float mean = 0, max = 0, min = 0, deviation = 0, sum = 0, rss = 0;
  std::uint32_t collapses = 0;
  template <class S, class A>
  static void archive(S& s, A& a) { a(s.mean, s.max, s.min, s.deviation, s.sum, s.rss, s.collapses); }
};

/// Index k below counts NestedScales::scales (0 = S_0), not scale numbers.
struct PerceptualValues {
  std::vector<CollapseStatistics> step;   // [k]: change from k-1 to k; [0] all zero
  std::vector<float> p95, p99;            // [i * n + j], j > i: relative distance of S_i's points to S_j; else 0
  std::vector<std::uint8_t> major;        // [k]: 1 = last of its tier
  std::vector<std::uint8_t> kept;         // [k]: 1 = stored in the package (S_0, majors, about kept_scales steps)
  std::vector<float> display_px_edge;     // [k]: O_V / E_S, the displayed height in px that the scale's edges match
  std::vector<float> display_px_error;    // [k]: displayed height in px up to which the scale's p95 error is <= 1 px
  std::vector<float> display_px_jnd;      // [k]: displayed height in px up to which the JND rule is content with it
  float object_height = 0;                // O_V: largest extent of the bounding box, object units
  template <class S, class A>
  static void archive(S& s, A& a) {
    a(s.step, s.p95, s.p99, s.major, s.kept, s.display_px_edge, s.display_px_error, s.display_px_jnd, s.object_height);
  }
};

PerceptualValues measure_perceptual_values(const NestedScales& scales, const Skeleton& skeleton,
                                           const PerceptualValuesOptions& options, const RunContext& context);

}  // namespace texmesh
