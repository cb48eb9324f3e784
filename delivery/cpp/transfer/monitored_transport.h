#pragma once
#include <functional>
#include <map>

#include "delivery/cpp/decide/bandwidth_monitor.h"
#include "delivery/cpp/transfer/transfer.h"

namespace texmesh {

/// A transport that sends a monitor's test packets beside the requests, and tells nobody of their outcomes.
/// A packet goes out when it is due and a request is under way, to the mirror that was asked last. It takes
/// its part of the link: that is what monitoring costs. HTTP has no packets of its own kind: a packet is a
/// range of a file, whose bytes are dropped.
class MonitoredTransport final : public Transport {
 public:
  /// What to ask for, for a packet of so many bytes; empty: no packet can be had. Models need none: `{}`.
  using Packet = std::function<std::vector<PackagePart>(std::uint64_t bytes, std::uint32_t nth)>;
  /// The number of a test packet's request; no other request may have it.
  static constexpr std::uint32_t kPacketNumber = 0xfffffffe;
  MonitoredTransport(Transport& inner, BandwidthMonitor& monitor, double rtt_s, Packet packet = {})
      : inner_(inner), monitor_(monitor), rtt_s_(rtt_s), packet_(std::move(packet)) {}

  std::size_t mirrors() const override { return inner_.mirrors(); }
  double now_s() override { return inner_.now_s(); }
  void start(const TransferRequest& request, std::uint32_t mirror) override;
  void cancel(std::uint32_t number) override;
  void forget(std::uint32_t number) override;
  double received(std::uint32_t number) override { return inner_.received(number); }
  std::optional<Outcome> wait(double until_s) override;
  /// Ends a packet that is under way.
  void stop();

 private:
  void send_packet();
  double moved_bytes();

  Transport& inner_;
  BandwidthMonitor& monitor_;
  double rtt_s_;
  Packet packet_;
  struct UnderWay {
    double bytes = 0, before = 0;  // of the whole request; what had come of it when it was started
  };
  std::map<std::uint32_t, UnderWay> under_way_;
  std::uint32_t mirror_ = 0;  // asked last
  double ended_bytes_ = 0;    // of requests that are under way no longer
  double moved_before_ = 0;
  bool packet_under_way_ = false;
};

}  // namespace texmesh
