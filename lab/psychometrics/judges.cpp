#include "lab/psychometrics/judges.h"

#include <algorithm>

#include "format/base/portable_math.h"

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

}  // namespace texmesh
