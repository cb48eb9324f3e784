#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace texmesh {

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

}  // namespace texmesh
