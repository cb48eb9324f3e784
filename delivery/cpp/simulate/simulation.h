#pragma once

#include "delivery/cpp/transfer/transfer.h"

namespace texmesh {

/// A link's rate over time: rate i holds from time i on, the last one for ever. Times rise strictly from 0.
struct BandwidthTrace {
  std::vector<double> time_s{0};
  std::vector<double> bytes_s{1e5};  // >= 0; the last one > 0, so that every transfer ends

  static BandwidthTrace constant(double bytes_s);
  double at(double t_s) const;
  double mean(double from_s, double to_s) const;
};
/// Lines "seconds,bytes per second"; a first line that is no numbers is a heading; blanks and # comments are
/// left out. InputError names the line.
BandwidthTrace read_trace_csv(std::string_view text, const std::string& name);

/// Where requests go to. A mirror that is dead from some time on answers nothing.
struct MirrorModel {
  BandwidthTrace rate = BandwidthTrace::constant(1e12);  // of its own, on top of the client's link
  double dead_from_s = 1e300;
  double lies_from_s = 1e300;  // what it delivers from then on is wrong
};
struct NetworkOptions {
  BandwidthTrace link;  // of the client, shared by everything in flight
  double rtt_s = 0;
  int connections = 6;         // per mirror; a request beyond them waits
  bool connect_costs = false;  // the first request of a connection takes another round trip
  bool slow_start = false;     // a connection's rate is at most window / round trip, from 10 packets on
  double loss = 0;         // share of packets lost, 0 .. 0.5: each costs a round trip and halves the window
  std::uint64_t seed = 1;  // of the losses
  std::vector<MirrorModel> mirrors{1};
};

/// A model of requests over shared links, event by event: rates change only where a transfer starts or ends,
/// a trace steps, a window grows or a packet is lost, and between these moments everything is linear, so that
/// results are exact. Links are shared evenly among transfers, what one cannot use going to the others.
/// Deterministic: the same bits everywhere.
class NetworkModel {
 public:
  explicit NetworkModel(NetworkOptions options);  // std::invalid_argument

  struct Arrival {
    std::uint32_t request = 0;
    double time_s = 0;
  };
  double now_s() const { return now_s_; }
  /// Asks mirror `mirror` for `bytes` now; the number is the caller's own and comes back in its Arrival.
  void request(std::uint32_t number, std::uint32_t mirror, double bytes);
  void cancel(std::uint32_t number);
  std::optional<double> bytes_left(std::uint32_t number) const;  // of a request under way
  /// Runs until a request is complete or the time comes, whichever is first. Nothing, and no time passes,
  /// when all that is under way was asked of dead mirrors and `until_s` is 1e9 or more.
  std::optional<Arrival> advance(double until_s);

 private:
  struct Flow {
    std::uint32_t number = 0, mirror = 0, connection = 0;
    double bytes_left = 0;
    double starts_s = 0;       // when its first byte may flow; infinite while it waits for a connection
    double rate = 0;           // bytes per second at present
    double next_loss = 1e300;  // bytes until the next lost packet
    double paused_until_s = 0;
  };
  struct Connection {
    bool busy = false, opened = false;
    double window_bytes = 14600;
    double grows_s = 1e300;  // when the window doubles next
  };
  void start_waiting();
  void share_rates();
  double next_event_s(double until_s) const;
  void move_to(double time_s);
  bool active(const Flow& f) const;
  bool dead() const;
  double random();

  NetworkOptions options_;
  std::vector<std::vector<Connection>> connections_;  // [mirror]
  std::vector<Flow> flows_;                           // by order of request
  double now_s_ = 0;
  std::uint64_t random_state_;
};

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
