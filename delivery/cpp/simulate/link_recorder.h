#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "delivery/cpp/simulate/network_model.h"

namespace texmesh {

/// Records what a link carries, to be played again by `simulate --trace`. The caller gives the times, which
/// must not fall; those of the trace count from the first request on.
class LinkRecorder {
 public:
  void asked(double time_s);
  void received(double time_s, double bytes);
  void ended(double time_s);
  double bytes() const { return bytes_; }

  /// Steps of at least `step_s` > 0. A link is measured while it carries: from an arrival to the next one, or
  /// from a round trip after the first request that follows a pause. What it could have carried while nothing
  /// was asked for is not known: the rate before holds there. Nothing when nothing was received.
  std::optional<BandwidthTrace> trace(double rtt_s, double step_s) const;

 private:
  enum class Kind : std::uint8_t { kAsked, kBytes, kEnded };
  struct Event {
    Kind kind = Kind::kAsked;
    double time_s = 0, bytes = 0;
  };
  void add(Kind kind, double time_s, double bytes);
  std::vector<Event> events_;
  double bytes_ = 0;
};

/// What read_trace_csv() reads. `comment` stands above it, a line for each of its lines.
std::string trace_csv(const BandwidthTrace& trace, const std::string& comment);

}  // namespace texmesh
