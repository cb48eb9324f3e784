#include "lab/psychometrics/threshold_study.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"
#include "stages/base/parallel.h"

namespace texmesh {
namespace {

using Counts = std::vector<LevelCount>;

Counts summed(const std::vector<const Counts*>& parts) {
  Counts all;
  for (const Counts* part : parts) all.insert(all.end(), part->begin(), part->end());
  return merge_levels(all);
}

std::vector<Counts> by_condition(const std::vector<const JudgeTable*>& judges, std::size_t conditions) {
  std::vector<Counts> out;
  for (std::size_t c = 0; c < conditions; ++c) {
    std::vector<const Counts*> parts;
    for (const JudgeTable* judge : judges) parts.push_back(&judge->conditions[c]);
    out.push_back(summed(parts));
  }
  return out;
}

Counts pooled(const std::vector<Counts>& conditions) {
  std::vector<const Counts*> parts;
  for (const Counts& c : conditions) parts.push_back(&c);
  return summed(parts);
}

/// As many answers again, each right as likely as an answer was.
Counts drawn_answers(const Counts& counts, SplitMix& random) {
  Counts out = counts;
  for (LevelCount& c : out) {
    const double share = static_cast<double>(c.right) / c.answers;
    c.right = 0;
    for (std::uint32_t k = 0; k < c.answers; ++k) c.right += random.next() < share;
  }
  return out;
}

struct Line {
  double at_reference = 0, exponent = 0;
};

/// log threshold = log at_reference - exponent log(D / reference), least squares.
Line law_of(const std::vector<double>& thresholds, const std::vector<double>& displayed_px,
            double reference_px) {
  double y = 0, xx = 0, xy = 0;
  for (std::size_t c = 0; c < thresholds.size(); ++c) {
    const double at = portable::log(displayed_px[c] / reference_px), value = portable::log(thresholds[c]);
    y += value, xx += at * at, xy += at * value;
  }
  return {portable::exp(y / static_cast<double>(thresholds.size())), xx > 1e-12 ? -xy / xx : 0};
}

/// What one draw gives: thresholds of the sigmoids and of the lines, of the conditions and then pooled.
struct Draw {
  std::vector<double> sigmoid, line;
  Line law;
};

Draw draw_of(const std::vector<Counts>& conditions, const std::vector<double>& displayed_px,
             double reference_px) {
  Draw out;
  std::vector<Counts> all = conditions;
  all.push_back(pooled(conditions));
  for (const Counts& counts : all) {
    out.sigmoid.push_back(fit_psychometric(counts).curve.threshold);
    out.line.push_back(fit_line(counts).threshold);
  }
  out.law = law_of({out.sigmoid.begin(), out.sigmoid.end() - 1}, displayed_px, reference_px);
  return out;
}

std::vector<Counts> drawn_conditions(const std::vector<JudgeTable>& judges, const std::vector<Counts>& all,
                                     bool by_judges, SplitMix& random) {
  std::vector<Counts> out;
  if (!by_judges) {
    for (const Counts& counts : all) out.push_back(drawn_answers(counts, random));
    return out;
  }
  std::vector<const JudgeTable*> drawn;
  for (std::size_t k = 0; k < judges.size(); ++k) drawn.push_back(&judges[random.below(judges.size())]);
  out = by_condition(drawn, all.size());
  for (std::size_t c = 0; c < all.size(); ++c)
    if (out[c].empty()) out[c] = all[c];  // none of the drawn judges has seen it
  return out;
}

template <class Get>
Estimate estimate(double value, const std::vector<Draw>& draws, Get&& get) {
  std::vector<double> sorted;
  for (const Draw& d : draws)
    if (std::isfinite(get(d))) sorted.push_back(get(d));
  std::ranges::sort(sorted);
  if (sorted.empty()) return {value, value, value};
  const auto at = [&](double part) {
    return sorted[static_cast<std::size_t>(part * static_cast<double>(sorted.size() - 1) + 0.5)];
  };
  return {value, at(0.025), at(0.975)};
}

void check_tables(const std::vector<JudgeTable>& judges, const std::vector<double>& displayed_px, int draws) {
  if (draws < 40 || displayed_px.empty()) throw std::invalid_argument("too few draws or conditions");
  for (const double px : displayed_px)
    if (!std::isfinite(px) || px <= 0) throw std::invalid_argument("a displayed size is not above 0");
  for (const JudgeTable& j : judges)
    if (j.conditions.size() != displayed_px.size())
      throw std::invalid_argument("a judge of other conditions");
}

ConditionFit fit_condition(const Counts& counts, std::size_t index, const std::vector<Draw>& draws) {
  ConditionFit fit{counts, fit_psychometric(counts), fit_line(counts), {}, {}};
  fit.threshold =
      estimate(fit.sigmoid.curve.threshold, draws, [index](const Draw& d) { return d.sigmoid[index]; });
  fit.line_threshold = estimate(fit.line.threshold, draws, [index](const Draw& d) { return d.line[index]; });
  return fit;
}

}  // namespace

ThresholdStudy study_thresholds(const std::vector<JudgeTable>& judges,
                                const std::vector<double>& displayed_px, int draws, std::uint64_t seed,
                                const RunContext& context) {
  check_tables(judges, displayed_px, draws);
  std::vector<const JudgeTable*> every;
  for (const JudgeTable& j : judges) every.push_back(&j);
  const std::vector<Counts> all = by_condition(every, displayed_px.size());
  double log_sum = 0;
  for (const double px : displayed_px) log_sum += portable::log(px);
  ThresholdStudy study;
  study.law.reference_px = portable::exp(log_sum / static_cast<double>(displayed_px.size()));
  study.by_judges = judges.size() >= kLeastJudgesToDraw;
  const Draw fitted = draw_of(all, displayed_px, study.law.reference_px);
  std::vector<Draw> drawn(static_cast<std::size_t>(draws));
  parallel_for(context, drawn.size(), 8, [&](std::size_t begin, std::size_t end) {
    for (std::size_t k = begin; k < end; ++k) {
      SplitMix random(SplitMix(SplitMix(seed).bits() + k).bits());  // no seed shares draws with the next
      drawn[k] = draw_of(drawn_conditions(judges, all, study.by_judges, random), displayed_px,
                         study.law.reference_px);
    }
  });
  study.within = true;
  for (std::size_t c = 0; c < all.size(); ++c) {
    study.conditions.push_back(fit_condition(all[c], c, drawn));
    study.within = study.within && study.conditions.back().sigmoid.within;
  }
  study.pooled = fit_condition(pooled(all), all.size(), drawn);
  study.law.jnd = estimate(fitted.law.at_reference, drawn, [](const Draw& d) { return d.law.at_reference; });
  study.law.exponent = estimate(fitted.law.exponent, drawn, [](const Draw& d) { return d.law.exponent; });
  return study;
}

}  // namespace texmesh
