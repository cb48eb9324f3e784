// Which judges count, the curve through their answers to one size of object, and what follows for all sizes.
#include "lab/psychometrics/psychometrics.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "format/base/portable_math.h"
#include "format/rules/split_mix.h"
#include "stages/base/parallel.h"

namespace texmesh {

double binomial_at_most(std::uint32_t k, std::uint32_t n, double p) {
  if (k >= n) return 1;
  double log_term = n * portable::log(1 - p), sum = portable::exp(log_term);
  for (std::uint32_t i = 1; i <= k; ++i) {
    log_term += portable::log(static_cast<double>(n - i + 1) / i) + portable::log(p / (1 - p));
    sum += portable::exp(log_term);
  }
  return std::min(sum, 1.0);
}

JudgeVerdict screen_judge(const JudgeCounts& judge, const JudgeLimits& limits) {
  if (judge.answers < limits.least_answers || judge.catches < limits.least_catches)
    return JudgeVerdict::kTooFew;
  const std::uint32_t rarer = std::min(judge.left, judge.answers - judge.left);
  if (2 * binomial_at_most(rarer, judge.answers, 0.5) < limits.one_side_p) return JudgeVerdict::kOneSide;
  if (binomial_at_most(judge.caught, judge.catches, limits.attentive_share) < limits.inattentive_p)
    return JudgeVerdict::kInattentive;
  return JudgeVerdict::kKept;
}

namespace {

/// Logarithm of the threshold, logarithm of the slope, lapse.
using Place = std::array<double, 3>;

struct Box {
  Place low, high;
  Place clamp(Place p) const {
    for (std::size_t k = 0; k < 3; ++k) p[k] = std::clamp(p[k], low[k], high[k]);
    return p;
  }
};

struct Vertex {
  Place place;
  double value = 0;  // the likelihood's logarithm, negated
};

void check_counts(std::span<const LevelCount> counts) {
  std::uint64_t answers = 0;
  for (const LevelCount& c : counts) {
    if (!std::isfinite(c.level) || c.level <= 0) throw std::invalid_argument("a level is not above 0");
    if (c.right > c.answers) throw std::invalid_argument("more right answers than answers");
    answers += c.answers;
  }
  if (answers == 0) throw std::invalid_argument("no answers");
}

Psychometric curve_at(const Place& p) { return {portable::exp(p[0]), portable::exp(p[1]), p[2]}; }

double log_likelihood(std::span<const LevelCount> counts, const Psychometric& curve) {
  double sum = 0;
  for (const LevelCount& c : counts) {
    const double p = curve.share_right(c.level);
    if (c.right > 0) sum += c.right * portable::log(p);
    // A share of 1 leaves no room for a wrong answer.
    if (c.right < c.answers) sum += (c.answers - c.right) * portable::log(std::max(1 - p, 1e-12));
  }
  return sum;
}

/// Hooke and Jeeves (1961), within the box: a step along each axis that makes it better, once more in that
/// direction, and half as long where none does.
Vertex descended(std::span<const LevelCount> counts, const Box& box, Vertex best) {
  const auto at = [&](const Place& p) {
    const Place inside = box.clamp(p);
    return Vertex{inside, -log_likelihood(counts, curve_at(inside))};
  };
  for (Place step{0.15, 0.25, 0.02}; step[0] > 1e-6;) {
    Vertex tried = best;
    for (std::size_t k = 0; k < 3; ++k)
      for (const double way : {1.0, -1.0}) {
        Place p = tried.place;
        p[k] += way * step[k];
        if (const Vertex v = at(p); v.value < tried.value) tried = v;
      }
    if (tried.value > best.value - 1e-9) {
      for (double& s : step) s /= 2;
      continue;
    }
    Place p = tried.place;
    for (std::size_t k = 0; k < 3; ++k) p[k] += tried.place[k] - best.place[k];
    const Vertex further = at(p);
    best = further.value < tried.value ? further : tried;
  }
  return best;
}

/// The best of a coarse grid, so that the descent begins in the right valley.
Vertex best_of_grid(std::span<const LevelCount> counts, const Box& box) {
  constexpr int kThresholds = 10, kSlopes = 4;
  Vertex best{{}, std::numeric_limits<double>::infinity()};
  for (int t = 0; t <= kThresholds; ++t)
    for (int s = 0; s <= kSlopes; ++s)
      for (const double lapse : {0.0, kMostLapses / 2}) {
        const Place p{box.low[0] + (box.high[0] - box.low[0]) * t / kThresholds,
                      box.low[1] + (box.high[1] - box.low[1]) * s / kSlopes, lapse};
        const double value = -log_likelihood(counts, curve_at(p));
        if (value < best.value) best = {p, value};
      }
  return best;
}

double deviance_of(std::span<const LevelCount> counts, double fitted) {
  double saturated = 0;
  for (const LevelCount& c : counts) {
    if (c.answers == 0) continue;
    const double wrong = c.answers - c.right, n = c.answers;
    if (c.right > 0) saturated += c.right * portable::log(c.right / n);
    if (wrong > 0) saturated += wrong * portable::log(wrong / n);
  }
  return std::max(0.0, 2 * (saturated - fitted));
}

}  // namespace

std::vector<LevelCount> merge_levels(std::span<const LevelCount> counts) {
  std::vector<LevelCount> sorted(counts.begin(), counts.end()), out;
  std::ranges::stable_sort(sorted, {}, &LevelCount::level);
  for (const LevelCount& c : sorted) {
    if (c.answers == 0) continue;
    if (out.empty() || out.back().level != c.level)
      out.push_back(c);
    else
      out.back().answers += c.answers, out.back().right += c.right;
  }
  return out;
}

double Psychometric::share_right(double level) const {
  if (!(level > 0)) return 0.5;
  // The factor puts kThresholdShare, not the curve's middle, at the threshold.
  const double odds = (1 - 4 * lapse) * portable::exp(slope * portable::log(threshold / level));
  return 0.5 + (0.5 - lapse) / (1 + odds);
}

PsychometricFit fit_psychometric(std::span<const LevelCount> counts) {
  check_counts(counts);
  const std::vector<LevelCount> all = merge_levels(counts);
  const double least = all.front().level, most = all.back().level;
  const Box box{{portable::log(least / 4), portable::log(0.5), 0},
                {portable::log(most * 4), portable::log(20), kMostLapses}};
  const Vertex best = descended(all, box, best_of_grid(all, box));
  PsychometricFit fit;
  fit.curve = curve_at(best.place);
  fit.log_likelihood = -best.value;
  fit.deviance = deviance_of(all, fit.log_likelihood);
  fit.within = fit.curve.threshold >= least && fit.curve.threshold <= most;
  return fit;
}

LineFit fit_line(std::span<const LevelCount> counts) {
  check_counts(counts);
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (const LevelCount& c : counts) {
    n += c.answers, x += c.answers * c.level, y += c.right;
    xx += c.answers * c.level * c.level, xy += c.right * c.level;
  }
  const double spread = xx - x * x / n;
  LineFit fit;
  fit.slope = spread > 1e-12 * xx ? (xy - x * y / n) / spread : 0;
  fit.intercept = y / n - fit.slope * x / n;
  fit.threshold = fit.slope > 0 ? (kThresholdShare - fit.intercept) / fit.slope
                                : std::numeric_limits<double>::quiet_NaN();
  return fit;
}

namespace {

using Counts = std::vector<LevelCount>;

std::vector<Counts> by_condition(const std::vector<const JudgeTable*>& judges, std::size_t conditions) {
  std::vector<Counts> out(conditions);
  for (std::size_t c = 0; c < conditions; ++c) {
    for (const JudgeTable* judge : judges)
      out[c].insert(out[c].end(), judge->conditions[c].begin(), judge->conditions[c].end());
    out[c] = merge_levels(out[c]);
  }
  return out;
}

Counts pooled(const std::vector<Counts>& conditions) {
  Counts all;
  for (const Counts& c : conditions) all.insert(all.end(), c.begin(), c.end());
  return merge_levels(all);
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
  parallel_each(context, drawn.size(), 8, [&](std::size_t k) {
    SplitMix random(SplitMix(SplitMix(seed).bits() + k).bits());  // no seed shares draws with the next
    drawn[k] =
        draw_of(drawn_conditions(judges, all, study.by_judges, random), displayed_px, study.law.reference_px);
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
