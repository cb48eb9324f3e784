#pragma once

#include "delivery/cpp/simulate/simulation.h"
#include "format/rules/split_mix.h"

namespace texmesh {

// Chapter 4 on links that are made by code: one request at a time, Table 4.2, and Theorem 4.1.

/// The thesis's set-up: one request at a time, no latency, transfer k at the rate `rate(k, start time)`
/// (bytes per second, k = 1 .. n).
SimulationResult simulate_samples(std::vector<FragmentOffer> offers, const HtcOptions& options,
                                  const std::function<double(std::size_t, double)>& rate);
/// The same over a trace by time: a transfer takes as long as the trace needs to carry it.
SimulationResult simulate_serial_trace(std::vector<FragmentOffer> offers, const HtcOptions& options,
                                       const BandwidthTrace& trace);

/// Deterministic random numbers for traces: even ones by SplitMix64, normal values by Box and Muller
/// with portable functions.
class TraceRandom {
 public:
  explicit TraceRandom(std::uint64_t seed) : numbers_(seed) {}
  double uniform();  // (0, 1]
  double normal();

 private:
  SplitMix numbers_;
};
/// A trace with steps of step_s whose logarithm is an AR(1) process: mean and coefficient of variation as
/// asked for, correlation rho between neighbours.
BandwidthTrace random_trace(double mean_bytes_s, double cv, double rho, double step_s, double length_s,
                            std::uint64_t seed);

/// Table 4.2 of the thesis: 256 fragments of 418 KB by Eq. 3.2, a link of 41.68 KB/s on average, beta_0 from
/// 20 to 53 KB/s, T_0 = 418 KB / beta_0.
struct Table42Row {
  double beta0_kb_s = 0, t0_s = 0;
  double static_percent = 0;  // what a transfer that does not adapt leaves of the limit, in the mean
  // Mean of |deviation| over the seeds, a throughput sample per fragment, cv 0.2.
  double deviation_percent = 0;
  double worst_percent = 0;                                     // its largest
  double trace_deviation_percent = 0, trace_worst_percent = 0;  // traces by time: cv 0.3, 0.1 s, rho 0.9
  double surplus_percent = 0;  // Pi, with its sign, of the limit: mean over the seeds
  double lambda_s = 0;         // Lambda: mean of dT_k of all fragments but the last, mean over the seeds
};
/// Qualities of the table's rungs: kTen = 10, 20 .. 100; kFine = steps of 5, and finer ones where bytes grow
/// fastest. The limits of quality are 40 and 100, as the thesis's.
enum class Table42Rungs : std::uint8_t { kTen, kFine };
std::vector<Table42Row> table_4_2(const HtcOptions& options, int seeds = 20,
                                  Table42Rungs rungs = Table42Rungs::kFine);
/// The list of that table: sizes as photographs have them, made by code.
std::vector<FragmentOffer> table_4_2_offers(Table42Rungs rungs = Table42Rungs::kFine);
/// Lambda of a run in which every fragment was transferred, s.
double lambda_of(const SimulationResult& result);

/// The bounds of the thesis for a finished serial run, printed and corrected (Appendix A).
struct HtcTheorem {
  double surplus_s = 0;          // Pi
  double last_residual_s = 0;    // dT_n: equal to Pi
  double corrected_bound_s = 0;  // theta_n |beta_{n-1} / beta_n - 1| + rounding to a rung at beta_n
  double published_bound_s = 0;  // Theorem 4.1 as printed, whose proof drops a term; a diagnostic
};
/// For plans with one request at a time in which nothing failed; beta_n is the last transfer's throughput.
HtcTheorem theorem_of(const HarmonicTimePlan& plan);
/// One transfer of the table's list over a random link, at a throughput of its own for each fragment, within
/// kTheoremLimit_s: run `seed` of 1 .. `runs`, whose beta_0 goes from 20 to 53 KB/s.
constexpr double kTheoremLimit_s = 10;
HtcTheorem theorem_run(const HtcOptions& base, const std::vector<FragmentOffer>& offers, int seed, int runs);

}  // namespace texmesh
