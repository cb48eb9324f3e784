#pragma once

#include "delivery/cpp/decide/harmonic_time.h"

namespace texmesh {

/// The bounds of the thesis for a finished serial run, printed and corrected (Appendix A).
struct HtcTheorem {
  double surplus_s = 0;          // Pi
  double last_residual_s = 0;    // dT_n: equal to Pi
  double corrected_bound_s = 0;  // theta_n |beta_{n-1} / beta_n - 1| + rounding to a rung at beta_n
  double published_bound_s = 0;  // Theorem 4.1 as printed, whose proof drops a term; a diagnostic
};
/// For plans with one request at a time in which nothing failed; beta_n is the last transfer's throughput.
HtcTheorem theorem_of(const HarmonicTimePlan& plan);

}  // namespace texmesh
