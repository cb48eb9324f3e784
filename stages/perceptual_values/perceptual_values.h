#pragma once

#include "format/rules/jnd_choice.h"
#include "stages/data/nested_scales.h"
#include "stages/data/perceptual_values.h"
#include "stages/data/scale_map.h"
#include "stages/data/stage.h"

namespace texmesh {

inline constexpr int kPerceptualValuesVersion = 9;

/// What makes the step function of the JND. kScales: every kept scale, by its distance from S_0. kTiers: the
/// displayed size chooses a scale by O_V / E_S (7.6); its tier's major scale is shown in its place.
enum class StepsBy : std::uint8_t { kScales, kTiers };
template <>
struct EnumNames<ChainRule> {
  static constexpr std::array<std::string_view, 2> names{"root-of-squares", "survivor"};
};
template <>
struct EnumNames<StepsBy> {
  static constexpr std::array<std::string_view, 2> names{"scales", "tiers"};
};

/// Displayed height in px at which judges' JND holds by default: the thesis's stimuli stood side by side on
/// monitors of 1024..1280 px (Table 7.3; Fig. 7.14 speaks of 90..170 px from skeleton to surface).
inline constexpr double kJndReferencePx = 512;

struct PerceptualValuesOptions {
  double jnd = 0.10;
  double jnd_reference_px = kJndReferencePx;
  double jnd_distance_exponent = 1;  // what is just noticeable at D px: jnd (jnd_reference_px / D)^exponent
  PerceptualStatistic statistic = PerceptualStatistic::kP95;
  ChainRule chain = ChainRule::kRootOfSquares;
  StepsBy steps = StepsBy::kScales;
  int samples = 4000;          // the percentiles' ranks are within 0.5 % then
  int kept_scales = 8;         // beside S_0 and the major ones
  double edge_percentile = 5;  // gives E_S of the O_V / E_S rule; 0 = the shortest edge
  static void fields(auto& s, auto&& v) {
    v("jnd", s.jnd, Range{0.001, 1}, "just-noticeable relative change of the distance to the skeleton");
    v("jnd_reference_px", s.jnd_reference_px, Range{1, 100000}, ProfileOnly{},
      "displayed height of the object in px at which that difference is just noticeable");
    v("jnd_distance_exponent", s.jnd_distance_exponent, Range{0, 2}, ProfileOnly{},
      "e of the change that is just noticeable at D px: jnd x (jnd_reference_px / D)^e. 0 = the same at "
      "every "
      "distance, as the thesis prints; 1 is a guess until judges have been asked (docs/lab/experiments.md)");
    v("statistic", s.statistic, ProfileOnly{},
      "what decides about major scales: p95 of the relative distance, or the thesis's average, "
      "conservative (largest) and aggressive (smallest) change of the skeleton distance");
    v("chain", s.chain, ProfileOnly{},
      "what becomes of the collapses of several scale changes, for the thesis's statistics: root-of-squares "
      "= of the changes between; survivor = each removed vertex against the one that is left, as 7.2 prints");
    v("steps", s.steps, ProfileOnly{},
      "what makes the JND's step function: scales = each kept scale, by jnd and jnd_reference_px; tiers = the "
      "major scales, each for the sizes at which O_V / E_S asks for a scale of its tier");
    v("samples", s.samples, Range{100, 1000000}, ProfileOnly{},
      "most points compared per pair of scales: one for every fourth triangle of the finer one, at least 250");
    v("kept_scales", s.kept_scales, Range{0, 40},
      "scales a package holds, about; steps of about 2x between them. 0 = S_0, the major scales and the "
      "coarsest alone");
    v("edge_percentile", s.edge_percentile, Range{0, 50}, ProfileOnly{},
      "percentile of the edge lengths that counts as shortest edge");
  }
};

/// Stands for "any displayed height" where a scale does not differ from S_0.
inline constexpr float kAnyHeightPx = 1e9f;

/// Table 7.2 from Table 7.1: [i * n + j], j > i: the change from scale i to scale j as the root of the sum of
/// the squared changes of the steps between (the thesis prints 0.041 .. 0.108 where this gives 0.041 ..
/// 0.112; the plain sum would be 0.245). `strategy` is one of the thesis's; StageError for a percentile.
std::vector<float> cumulative_table(const std::vector<CollapseStatistics>& step,
                                    PerceptualStatistic strategy);

/// The table of n x n values that `statistic` decides by; `chain` is for the thesis's strategies.
std::vector<float> value_table(const PerceptualValues& values, PerceptualStatistic statistic,
                               ChainRule chain = ChainRule::kRootOfSquares);

/// Throws StageError when the skeleton is of another mesh. Same bytes for any thread count.
PerceptualValues measure_perceptual_values(const NestedScales& scales, const Skeleton& skeleton,
                                           const PerceptualValuesOptions& options, const RunContext& context);

}  // namespace texmesh
