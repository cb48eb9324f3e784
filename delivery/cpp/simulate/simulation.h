#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "delivery/cpp/decide/bandwidth_monitor.h"
#include "delivery/cpp/decide/harmonic_time.h"
#include "delivery/cpp/simulate/network_model.h"
#include "delivery/cpp/transfer/transfer.h"
#include "format/rules/split_mix.h"

namespace texmesh {

/// A transfer, played through without a network or a real one.
struct SimulationResult {
  /// Simulated, and some fragments never arrive because every server that was asked has died: end_s and
  /// late_s are +infinity then, deviation_percent is -infinity, and the fragments count as given up.
  bool never = false;
  double time_limit_s = 0, end_s = 0;
  double deviation_percent = 0;  // of the limit: positive = ended early (the thesis's surplus)
  double late_s = 0;
  std::uint64_t bytes = 0;
  std::uint32_t skipped = 0;   // by decision, or not decided when it ended; given up ones, too
  std::uint32_t given_up = 0;  // asked for, and never delivered
  // Sums of the offers' losses: as shown, and if all were at their planned size.
  double loss = 0, planned_loss = 0;
  std::vector<HtcStep> steps;
  std::vector<std::int32_t> rungs;  // by offer
  std::vector<MirrorShare> mirrors;
  // Of the monitor, where there was one; its bytes are not among `bytes`.
  std::vector<BandwidthSample> samples;
  std::uint32_t probes = 0;
  std::uint64_t probe_bytes = 0;
};

/// What became of a plan that has ended, or was left, at `end_s`.
SimulationResult result_of(const HarmonicTimePlan& plan, double limit_s, double end_s);

/// Plays the plan over the network model, as transfer() runs it over a network, with a monitor's test packets
/// beside it. The plan hears of throughput from its own transfers alone.
SimulationResult simulate(std::vector<FragmentOffer> offers, const HtcOptions& options,
                          const NetworkOptions& network, const ProbeOptions& probe = {});
/// The network without the mirrors that a client has found dead by then, unless that is all of them.
NetworkOptions without_dead_mirrors(NetworkOptions network, double now_s);
/// The network as it is from `by_s` on: its times count from there.
NetworkOptions network_from(NetworkOptions network, double by_s);
/// Time at which so many bytes asked for at `from_s` are complete on an otherwise idle network, from
/// whichever of its mirrors answers; +infinity when none does.
double fetched_s(const NetworkOptions& network, double from_s, std::uint64_t bytes);

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
  double mean_loss = 0;
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

}  // namespace texmesh
