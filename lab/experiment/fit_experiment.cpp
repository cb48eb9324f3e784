#include "lab/experiment/fit_experiment.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "format/base/errors.h"
#include "pipeline/io/table.h"

namespace texmesh {
namespace {

/// What every file must say of a trial.
using TrialKeys = std::map<std::uint32_t, DesignKey::Trial>;

void check_trials(const ExperimentResults& results, TrialKeys& keys) {
  for (std::size_t k = 0; k < results.answers.size(); ++k) {
    const ExperimentAnswer& a = results.answers[k];
    const auto [at, is_new] =
        keys.try_emplace(a.trial, DesignKey::Trial{a.displayed_px, a.level, a.is_catch});
    const DesignKey::Trial& t = at->second;
    if (t.displayed_px == a.displayed_px && t.level == a.level && t.is_catch == a.is_catch) continue;
    const auto text = [](double px, double level, bool is_catch) {
      return fmt::format("a change of {:g} at {:g} px{}", level, px, is_catch ? " as a catch trial" : "");
    };
    throw InputError(results.file, fmt::format("/answers/{}", k),
                     text(t.displayed_px, t.level, t.is_catch) + fmt::format(" in trial {}", a.trial),
                     text(a.displayed_px, a.level, a.is_catch));
  }
}

void check_files(const std::vector<ExperimentResults>& results, const std::optional<DesignKey>& key) {
  if (results.empty()) throw InputError("results", "", "at least one file", "none");
  const ExperimentResults& first = results.front();
  TrialKeys keys;
  if (key)
    for (std::uint32_t t = 0; t < key->trials.size(); ++t) keys[t] = key->trials[t];
  for (const ExperimentResults& r : results) {
    const std::string& wanted = key ? key->id : first.design;
    if (r.design != wanted)
      throw InputError(r.file, "/design", wanted + (key ? ", the given design" : ", as " + first.file),
                       r.design + ", another experiment");
    if (const std::size_t trials = key ? key->trials.size() : first.trials; r.trials != trials)
      throw InputError(r.file, "/trials", std::to_string(trials), std::to_string(r.trials));
    if (r.kind != (key ? key->kind : first.kind))
      throw InputError(r.file, "/kind", key ? key->kind : first.kind, r.kind);
    check_trials(r, keys);
  }
}

FittedJudge screened(const ExperimentResults& results, const JudgeLimits& limits) {
  FittedJudge judge{results.file, results.judge, {}, 0, 0, JudgeVerdict::kKept, false};
  for (const ExperimentAnswer& a : results.answers) {
    ++judge.counts.answers;
    judge.counts.left += !a.chose_right;
    judge.counts.catches += a.is_catch;
    judge.counts.caught += a.is_catch && a.right();
    judge.right += a.right();
    judge.late += a.late;
  }
  judge.verdict = screen_judge(judge.counts, limits);
  return judge;
}

JudgeTable table_of(const ExperimentResults& results, const std::vector<double>& sizes_px) {
  std::vector<std::map<double, LevelCount>> counts(sizes_px.size());
  for (const ExperimentAnswer& a : results.answers) {
    if (a.is_catch) continue;
    const auto c =
        static_cast<std::size_t>(std::ranges::lower_bound(sizes_px, a.displayed_px) - sizes_px.begin());
    LevelCount& count = counts[c][a.level];
    count.level = a.level;
    ++count.answers;
    count.right += a.right();
  }
  JudgeTable out;
  for (const auto& by_level : counts) {
    out.conditions.emplace_back();
    for (const auto& [level, count] : by_level) out.conditions.back().push_back(count);
  }
  return out;
}

std::vector<double> sizes_of(const std::vector<const ExperimentResults*>& kept) {
  std::vector<double> sizes;
  for (const ExperimentResults* r : kept)
    for (const ExperimentAnswer& a : r->answers)
      if (!a.is_catch) sizes.push_back(a.displayed_px);
  std::ranges::sort(sizes);
  sizes.erase(std::ranges::unique(sizes).begin(), sizes.end());
  return sizes;
}

std::string bounds_text(const Estimate& e, int digits) {
  return fmt::format("{:.{}f}, 95 % from {:.{}f} to {:.{}f}", e.value, digits, e.low, digits, e.high, digits);
}

std::string distance_text(const ExperimentFit& fit) {
  const DistanceLaw& law = fit.study.law;
  if (fit.sizes_px.size() < 2)
    return "One displayed size says nothing about distance: the profile holds at every distance, as the thesis prints.";
  const std::string e = bounds_text(law.exponent, 2);
  if (law.may_be_printed() && law.may_be_inverse())
    return "Undecided: the exponent of distance is " + e +
           ", which may be 0 (as printed) or 1 (512 / D). The profile holds at every distance until more judges "
           "have answered.";
  if (law.may_be_printed())
    return "The threshold does not follow the displayed size (exponent " + e + "): as the thesis prints.";
  if (law.may_be_inverse())
    return "The threshold follows the displayed size (exponent " + e + "): 1 / D, not as the thesis prints.";
  return "The threshold follows the displayed size with an exponent of " + e +
         ": neither as printed nor 1 / D.";
}

void judge_sigmoid(ExperimentFit& fit) {
  fit.jnd = fit.study.law.jnd;
  fit.found = fit.study.within;
  if (fit.sizes_px.size() > 1 && !fit.study.law.may_be_printed())
    fit.distance_exponent = std::clamp(std::round(fit.study.law.exponent.value * 100) / 100, 0.0, 2.0);
}

void judge_line(ExperimentFit& fit) {
  const ConditionFit& all = fit.study.pooled;
  fit.jnd = all.line_threshold;
  fit.found = std::isfinite(fit.jnd.value) && fit.jnd.value >= all.counts.front().level &&
              fit.jnd.value <= all.counts.back().level;
}

std::string found_text(const ExperimentFit& fit) {
  if (fit.found)
    return fmt::format("75 % of the answers are right at a change of {}, shown {:g} px high.",
                       bounds_text(fit.jnd, 4), fit.reference_px);
  const std::vector<LevelCount>& c = fit.study.pooled.counts;
  const auto share = [](const LevelCount& l) { return 100.0 * l.right / l.answers; };
  return fmt::format(
      "No threshold: 75 % right lies outside the levels for at least one displayed size. At the smallest level, "
      "{:g}, {:.0f} % are right, at the largest, {:g}, {:.0f} %.",
      c.front().level, share(c.front()), c.back().level, share(c.back()));
}

[[noreturn]] void fail_without_judges(const ExperimentFit& fit) {
  std::string why;
  for (const FittedJudge& j : fit.judges) why += fmt::format("; {}: {}", j.file, verdict_text(j));
  throw InputError("results", "", "a judge whose answers can be used",
                   fmt::format("none of {}{}", fit.judges.size(), why.substr(0, 2000)));
}

}  // namespace

std::size_t ExperimentFit::kept() const {
  return static_cast<std::size_t>(
      std::ranges::count_if(judges, [](const FittedJudge& j) { return j.kept(); }));
}

std::string verdict_text(const FittedJudge& j) {
  if (j.repeated) return "left out: an earlier file holds the same answers";
  switch (j.verdict) {
    case JudgeVerdict::kTooFew:
      return fmt::format("left out: {} answers with {} catch trials are too few", j.counts.answers,
                         j.counts.catches);
    case JudgeVerdict::kOneSide:
      return fmt::format("left out: {} of {} answers are \"left\"", j.counts.left, j.counts.answers);
    case JudgeVerdict::kInattentive:
      return fmt::format("left out: {} of {} catch trials are right", j.counts.caught, j.counts.catches);
    case JudgeVerdict::kKept:
      break;
  }
  return "kept";
}

ExperimentFit fit_experiment(const std::vector<ExperimentResults>& results,
                             const std::optional<DesignKey>& key, const FitOptions& options,
                             const RunContext& context) {
  check_files(results, key);
  ExperimentFit fit;
  fit.design = results.front().design;
  fit.kind = results.front().kind;
  fit.options = options;
  std::vector<const ExperimentResults*> kept;
  for (const ExperimentResults& r : results) {
    FittedJudge judge = screened(r, options.limits);
    judge.repeated = !r.answers.empty() && std::ranges::any_of(kept, [&r](const ExperimentResults* other) {
      return other->answers == r.answers;
    });
    fit.judges.push_back(judge);
    if (judge.kept()) kept.push_back(&r);
  }
  fit.sizes_px = sizes_of(kept);
  if (kept.empty() || fit.sizes_px.empty()) fail_without_judges(fit);
  std::vector<JudgeTable> tables;
  for (const ExperimentResults* r : kept) tables.push_back(table_of(*r, fit.sizes_px));
  fit.study = study_thresholds(tables, fit.sizes_px, options.draws, options.seed, context);
  for (const LevelCount& c : fit.study.pooled.counts) fit.answers += c.answers;
  fit.reference_px = std::round(fit.study.law.reference_px);
  if (options.curve == FittedCurve::kLine)
    judge_line(fit);
  else
    judge_sigmoid(fit);
  fit.verdict = found_text(fit);
  fit.distance_verdict = distance_text(fit);
  return fit;
}

}  // namespace texmesh
