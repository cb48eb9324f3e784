#pragma once
#include <cstdint>
#include <functional>
#include <vector>

#include "delivery/cpp/decide/harmonic_time.h"
#include "delivery/cpp/simulate/network_model.h"
#include "delivery/cpp/transfer/transfer.h"

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
};

/// What became of a plan that has ended, or was left, at `end_s`.
SimulationResult result_of(const HarmonicTimePlan& plan, double limit_s, double end_s);

/// Plays the plan over the network model, as transfer() runs it over a network. `around`, where it is set,
/// gives a transport that stands between the two.
using TransportAround = std::function<Transport&(Transport& model)>;
SimulationResult simulate(std::vector<FragmentOffer> offers, const HtcOptions& options,
                          const NetworkOptions& network, const TransportAround& around = {});
/// The network without the mirrors that a client has found dead by then, unless that is all of them.
NetworkOptions without_dead_mirrors(NetworkOptions network, double now_s);
/// The network as it is from `by_s` on: its times count from there.
NetworkOptions network_from(NetworkOptions network, double by_s);
/// Time at which so many bytes asked for at `from_s` are complete on an otherwise idle network, from
/// whichever of its mirrors answers; +infinity when none does.
double fetched_s(const NetworkOptions& network, double from_s, std::uint64_t bytes);

}  // namespace texmesh
