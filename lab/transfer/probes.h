#pragma once

#include "delivery/cpp/simulate/simulation.h"

namespace texmesh {

/// How test packets go out (thesis 4.4, Fig. 4.3). kFixed: packets of one size at regular intervals.
/// kAdaptive: below the threshold packets become half as large and half as frequent, from the threshold on
/// twice as large and twice as frequent, each within a factor of 8 of where it began. The thesis names a
/// threshold and no rule.
enum class ProbeMode : std::uint8_t { kOff, kFixed, kAdaptive };

struct ProbeOptions {
  ProbeMode mode = ProbeMode::kOff;
  double packet_bytes = 8192;      // 64 .. 16 MiB
  double interval_s = 0.5;         // from the start of one packet to that of the next, 0.01 .. 3600
  double threshold_bytes_s = 1e5;  // > 0, of kAdaptive
};

struct BandwidthSample {
  double time_s = 0;        // when the packet was there
  double packet_bytes = 0;  // of the test packet
  double seconds = 0;       // from its request to its end, round trip taken off
  double bytes_s = 0;       // of the link: whatever else came in these seconds counts, too
};

/// When to send which test packet, and what they showed. No I/O and no clock: the caller gives the time. One
/// packet is under way at a time. Plain double arithmetic: the same bits everywhere.
class BandwidthMonitor {
 public:
  explicit BandwidthMonitor(const ProbeOptions& options);  // std::invalid_argument
  /// When the next packet is due; kNever_s while one is under way, and where the mode is kOff.
  static constexpr double kNever_s = 1e300;
  double next_s() const;
  /// Its size. The packet counts as sent.
  std::uint64_t send(double now_s);
  /// It is there. `moved_bytes`: all that the link has brought since send(), the packet included.
  void arrived(double now_s, double rtt_s, double moved_bytes);
  /// It did not come.
  void lost();
  const std::vector<BandwidthSample>& samples() const { return samples_; }
  std::uint32_t sent() const { return sent_; }
  std::uint64_t sent_bytes() const { return sent_bytes_; }  // asked for, lost ones included
  double packet_bytes() const { return packet_bytes_; }
  double interval_s() const { return interval_s_; }

 private:
  ProbeOptions options_;
  double packet_bytes_, interval_s_;
  double due_s_ = 0, sent_s_ = 0;
  bool under_way_ = false;
  std::uint32_t sent_ = 0;
  std::uint64_t sent_bytes_ = 0;
  std::vector<BandwidthSample> samples_;
};

/// A transport that sends a monitor's test packets beside the requests, and tells nobody of their outcomes.
/// A packet goes out when it is due and a request is under way, to the mirror that was asked last. It takes
/// its part of the link: that is what monitoring costs.
class MonitoredTransport final : public Transport {
 public:
  /// The number of a test packet's request; no other request may have it.
  static constexpr std::uint32_t kPacketNumber = 0xfffffffe;
  MonitoredTransport(Transport& inner, BandwidthMonitor& monitor, double rtt_s)
      : inner_(inner), monitor_(monitor), rtt_s_(rtt_s) {}

  std::size_t mirrors() const override { return inner_.mirrors(); }
  double now_s() override { return inner_.now_s(); }
  void start(const TransferRequest& request, std::uint32_t mirror) override;
  void cancel(std::uint32_t number) override;
  void forget(std::uint32_t number) override;
  double received(std::uint32_t number) override { return inner_.received(number); }
  std::optional<Outcome> wait(double until_s) override;

 private:
  void send_packet();
  double moved_bytes();

  Transport& inner_;
  BandwidthMonitor& monitor_;
  double rtt_s_;
  struct UnderWay {
    double bytes = 0, before = 0;  // of the whole request; what had come of it when it was started
  };
  std::map<std::uint32_t, UnderWay> under_way_;
  std::uint32_t mirror_ = 0;  // asked last
  double ended_bytes_ = 0;    // of requests that are under way no longer
  double moved_before_ = 0;
};

/// What a monitor did beside a simulated transfer. Its bytes are not among the transfer's.
struct ProbeResult {
  std::vector<BandwidthSample> samples;
  std::uint32_t packets = 0;
  std::uint64_t bytes = 0;
};
/// simulate() with test packets. The plan hears of throughput from its own transfers alone.
SimulationResult simulate_with_probes(const std::vector<FragmentOffer>& offers, const HtcOptions& options,
                                      const NetworkOptions& network, const ProbeOptions& probe,
                                      ProbeResult& result);

}  // namespace texmesh
