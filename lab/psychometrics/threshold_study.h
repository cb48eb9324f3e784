#pragma once
#include <cstdint>
#include <vector>

#include "lab/psychometrics/psychometric.h"
#include "stages/base/run_context.h"

namespace texmesh {

/// An estimate with the bounds between which 95 % of its bootstrapped values lie.
struct Estimate {
  double value = 0, low = 0, high = 0;
};

/// Answers of one judge, per condition (displayed size).
struct JudgeTable {
  std::vector<std::vector<LevelCount>> conditions;
};

struct ConditionFit {
  std::vector<LevelCount> counts;  // of all judges, one a level, by level
  PsychometricFit sigmoid;
  LineFit line;
  Estimate threshold;       // of the sigmoid
  Estimate line_threshold;  // NaN where the line does not rise
};

/// How the threshold follows the displayed size D: threshold = jnd * (reference / D)^exponent.
struct DistanceLaw {
  double reference_px = 0;  // geometric mean of the sizes
  Estimate jnd;             // at the reference
  Estimate exponent;        // 0 = as printed, the same at every distance; 1 = 512 / D
  /// 0 lies within the exponent's bounds: nothing speaks against the thesis.
  bool may_be_printed() const { return exponent.low <= 0 && exponent.high >= 0; }
  /// 1 lies within them.
  bool may_be_inverse() const { return exponent.low <= 1 && exponent.high >= 1; }
};

struct ThresholdStudy {
  std::vector<ConditionFit> conditions;  // as the judges' tables
  ConditionFit pooled;                   // of all conditions together
  DistanceLaw law;                       // with two or more sizes; else exponent 0 and the one threshold
  bool by_judges = false;                // whole judges were drawn, not single answers
  bool within = false;                   // all conditions' thresholds lie among their levels
};

/// With so many judges the bootstrap draws judges, which counts what parts them; with fewer it draws answers.
inline constexpr std::size_t kLeastJudgesToDraw = 5;

/// Fits every condition and draws `draws` times (Efron 1979; percentiles) with that seed. `displayed_px`, one
/// a condition, are above 0. std::invalid_argument for tables of other lengths, for draws < 40 and as
/// fit_psychometric(). Same bits for any thread count.
ThresholdStudy study_thresholds(const std::vector<JudgeTable>& judges,
                                const std::vector<double>& displayed_px, int draws, std::uint64_t seed,
                                const RunContext& context);

}  // namespace texmesh
