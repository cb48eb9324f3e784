#pragma once
#include <optional>

#include "lab/experiment/design.h"
#include "lab/psychometrics/psychometrics.h"

namespace texmesh {

/// What the answers are fitted with.
enum class FittedCurve : std::uint8_t { kSigmoid, kLine };

struct FitOptions {
  FittedCurve curve = FittedCurve::kSigmoid;
  int draws = 1000;
  std::uint64_t seed = 1;
  JudgeLimits limits;
};

/// What became of one file.
struct FittedJudge {
  std::string file, judge;
  JudgeCounts counts;
  std::uint32_t right = 0, late = 0;  // of all answers
  JudgeVerdict verdict = JudgeVerdict::kKept;
  bool repeated = false;  // an earlier file holds the same answers
  bool kept() const { return verdict == JudgeVerdict::kKept && !repeated; }
};
std::string verdict_text(const FittedJudge& judge);

struct ExperimentFit {
  std::string design, kind;
  FitOptions options;
  std::vector<FittedJudge> judges;  // as the files
  std::vector<double> sizes_px;     // rising
  ThresholdStudy study;
  std::uint64_t answers = 0;  // of kept judges, without catch trials
  /// Of moves: at which size, px, each level looks like the reference (Fig. 6.4): the median, and the bounds
  /// between which half of the answers lie.
  std::vector<std::pair<LevelCount, Estimate>> matches;
  std::size_t kept() const;

  // What the profile says:
  Estimate jnd;
  double reference_px = 0, distance_exponent = 0;
  bool found = false;  // the threshold lies among the levels; else there is no profile
  std::string verdict, distance_verdict;
};

/// Judges are screened (lab/psychometrics/psychometrics.h), the answers of the others fitted. InputError
/// naming the file when two files are of different experiments, when an answer does not agree with `key`,
/// when two answers give one trial other levels, and when no judge is left.
ExperimentFit fit_experiment(const std::vector<ExperimentResults>& results,
                             const std::optional<DesignKey>& key, const FitOptions& options,
                             const RunContext& context);

/// schemas/jnd-profile.v1.schema.json; only where `found`.
std::string jnd_profile_json(const ExperimentFit& fit);
/// lab/schemas/experiment-fit.v1.schema.json.
std::string fit_json(const ExperimentFit& fit);
/// Tables for a terminal.
std::string fit_text(const ExperimentFit& fit);
/// A page that stands alone, with the curves as SVG.
std::string fit_page(const ExperimentFit& fit);

}  // namespace texmesh
