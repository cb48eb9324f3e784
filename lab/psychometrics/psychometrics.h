#pragma once
#include <cstdint>
#include <span>
#include <vector>

#include "stages/base/run_context.h"

namespace texmesh {

/// What a judge did, in numbers.
struct JudgeCounts {
  std::uint32_t answers = 0;  // all of them, catch trials included
  std::uint32_t left = 0;     // answers "left"
  std::uint32_t catches = 0;  // trials that everybody who looks answers rightly
  std::uint32_t caught = 0;   // of them answered rightly
};

enum class JudgeVerdict : std::uint8_t { kKept, kTooFew, kOneSide, kInattentive };

struct JudgeLimits {
  std::uint32_t least_answers = 20, least_catches = 4;
  double attentive_share = 0.9;  // of catch trials that a judge who looks answers rightly
  double inattentive_p = 0.05;   // least likelihood of so few right catch trials for such a judge
  double one_side_p = 1e-4;      // of so many answers on one side when sides are balanced
};

/// Whether a judge's answers count. kTooFew: fewer answers or catch trials than the limits; kOneSide: one
/// side so often that chance is no excuse; kInattentive: too few catch trials right. The first that holds.
JudgeVerdict screen_judge(const JudgeCounts& judge, const JudgeLimits& limits = {});

/// The chance of at most k of n, each with probability p: 0 < p < 1. 1 for k >= n.
double binomial_at_most(std::uint32_t k, std::uint32_t n, double p);

// What judges of forced choices between two alternatives (thesis 5.6) can just tell. Pure numbers: the same
// bits on every machine.

/// Answers to one size of a change.
struct LevelCount {
  double level = 0;  // of the change, > 0
  std::uint32_t answers = 0, right = 0;
};

/// One count a level, by level; levels without answers go.
std::vector<LevelCount> merge_levels(std::span<const LevelCount> counts);

/// The share of right answers that is the threshold, half-way between guessing and seeing (thesis 5.6).
inline constexpr double kThresholdShare = 0.75;
/// Share of answers that a judge gives wrong however large the change is; more is no lapse but a bad judge
/// (Wichmann and Hill 2001).
inline constexpr double kMostLapses = 0.06;

/// A logistic curve of the level's logarithm from one half (guessing) to 1 - lapse.
struct Psychometric {
  double threshold = 1;  // the level with kThresholdShare of right answers, lapses counted
  double slope = 3;      // of the curve's odds: odds ~ level^slope
  double lapse = 0;      // 0..kMostLapses
  /// Expected share of right answers, 0.5..1; level >= 0.
  double share_right(double level) const;
};

struct PsychometricFit {
  Psychometric curve;
  double log_likelihood = 0;
  /// Twice what the likelihood misses against a curve through all points. Around the number of levels less 3
  /// for a good fit.
  double deviance = 0;
  bool within = false;  // the threshold lies between the smallest and the largest level
};

/// The curve of greatest likelihood. Its threshold is sought from a quarter of the smallest to four times the
/// largest level, its slope from 0.5 to 20. Levels may stand several times and in any order.
/// std::invalid_argument when a level is not finite or not above 0, when more answers are right than were
/// given, and without answers.
PsychometricFit fit_psychometric(std::span<const LevelCount> counts);

/// The straight line through the shares of right answers, of least weighted squares, as the thesis fits
/// Fig. 7.7.
struct LineFit {
  double intercept = 0, slope = 0;  // share = intercept + slope * level
  /// Where the line has kThresholdShare; NaN where it does not rise.
  double threshold = 0;
};
/// Errors as fit_psychometric().
LineFit fit_line(std::span<const LevelCount> counts);

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
