#include "delivery/cpp/decide/htc_theorem.h"

#include <algorithm>
#include <cmath>

#include "format/base/portable_math.h"

namespace texmesh {

HtcTheorem theorem_of(const HarmonicTimePlan& plan) {
  HtcTheorem t;
  const std::vector<HtcStep>& steps = plan.steps();
  if (steps.empty()) return t;
  const std::size_t n = steps.size();
  const HtcStep& last = steps.back();
  t.surplus_s = plan.surplus_s();
  t.last_residual_s = last.residual_s;
  if (last.bytes > 0) {
    const double beta_n = last.bytes / last.spacing_s;
    t.corrected_bound_s = std::abs(last.theta_s) * std::abs(last.throughput_bytes_s / beta_n - 1) +
                          std::abs(last.target_bytes - last.bytes) / beta_n;
  } else {
    t.corrected_bound_s = std::abs(last.theta_s);
  }
  double sum = 0;
  for (std::size_t k = 0; k + 1 < n; ++k) sum += steps[k].residual_s;
  const double mean = n > 1 ? sum / static_cast<double>(n - 1) : 0;
  const double log_n = portable::log(static_cast<double>(std::max<std::size_t>(n, 3)));
  t.published_bound_s =
      last.residual_s + (n > 1 ? steps[n - 2].residual_s / 2 : 0) + (1.088 + portable::log(log_n)) * mean;
  return t;
}

}  // namespace texmesh
