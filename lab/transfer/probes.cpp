#include "lab/transfer/probes.h"

#include <algorithm>
#include <stdexcept>

namespace texmesh {
namespace {

constexpr double kMostChange = 8;  // of size and interval, from where they began
constexpr double kLeastBytes = 64, kMostBytes = 1 << 24;
constexpr double kLeastInterval_s = 0.01, kMostInterval_s = 3600;
constexpr double kLeastPacket_s = 1e-4;
constexpr double kLeastShare = 0.2;  // of a packet's time: what comes in one burst says little of the link

/// Not for NaN either.
bool within(double x, double least, double most) { return x >= least && x <= most; }

}  // namespace

BandwidthMonitor::BandwidthMonitor(const ProbeOptions& options)
    : options_(options), packet_bytes_(options.packet_bytes), interval_s_(options.interval_s) {
  if (!within(options.packet_bytes, kLeastBytes, kMostBytes) ||
      !within(options.interval_s, kLeastInterval_s, kMostInterval_s) ||
      !within(options.threshold_bytes_s, 1e-9, 1e15))
    throw std::invalid_argument("BandwidthMonitor: size, interval or threshold out of range");
}

double BandwidthMonitor::next_s() const {
  return under_way_ || options_.mode == ProbeMode::kOff ? kNever_s : due_s_;
}

std::uint64_t BandwidthMonitor::send(double now_s) {
  sent_s_ = now_s;
  due_s_ = now_s + interval_s_;
  under_way_ = true;
  const auto bytes = static_cast<std::uint64_t>(packet_bytes_);
  ++sent_;
  sent_bytes_ += bytes;
  return bytes;
}

void BandwidthMonitor::arrived(double now_s, double rtt_s, double moved_bytes) {
  under_way_ = false;
  const double packet = static_cast<double>(static_cast<std::uint64_t>(packet_bytes_));
  const double seconds = std::max({kLeastPacket_s, kLeastShare * (now_s - sent_s_), now_s - sent_s_ - rtt_s});
  samples_.push_back({now_s, packet, seconds, std::max(packet, moved_bytes) / seconds});
  if (options_.mode != ProbeMode::kAdaptive) return;
  const double factor = samples_.back().bytes_s < options_.threshold_bytes_s ? 0.5 : 2;
  packet_bytes_ =
      std::clamp(packet_bytes_ * factor, std::max(kLeastBytes, options_.packet_bytes / kMostChange),
                 std::min(kMostBytes, options_.packet_bytes * kMostChange));
  interval_s_ =
      std::clamp(interval_s_ / factor, std::max(kLeastInterval_s, options_.interval_s / kMostChange),
                 std::min(kMostInterval_s, options_.interval_s * kMostChange));
  due_s_ = sent_s_ + interval_s_;
}

void BandwidthMonitor::lost() { under_way_ = false; }

void MonitoredTransport::start(const TransferRequest& request, std::uint32_t mirror) {
  mirror_ = mirror;
  inner_.start(request, mirror);
  under_way_[request.number] = {static_cast<double>(request.bytes), inner_.received(request.number)};
}

void MonitoredTransport::cancel(std::uint32_t number) {
  if (const auto it = under_way_.find(number); it != under_way_.end()) {
    ended_bytes_ += std::max(0.0, inner_.received(number) - it->second.before);
    under_way_.erase(it);
  }
  inner_.cancel(number);
}

void MonitoredTransport::forget(std::uint32_t number) {
  cancel(number);
  inner_.forget(number);
}

double MonitoredTransport::moved_bytes() {
  double bytes = ended_bytes_;
  for (const auto& [number, request] : under_way_)
    bytes += std::max(0.0, inner_.received(number) - request.before);
  return bytes;
}

void MonitoredTransport::send_packet() {
  const TransferRequest request{kPacketNumber, monitor_.send(now_s()), {}};
  moved_before_ = moved_bytes();
  inner_.start(request, mirror_);
}

std::optional<Transport::Outcome> MonitoredTransport::wait(double until_s) {
  for (;;) {
    const bool busy = !under_way_.empty();
    if (busy && now_s() >= monitor_.next_s()) send_packet();
    const double until = busy ? std::min(until_s, monitor_.next_s()) : until_s;
    std::optional<Outcome> outcome = inner_.wait(until);
    if (!outcome && until < until_s && now_s() >= until) continue;  // a packet is due
    if (!outcome) return outcome;
    if (outcome->number == kPacketNumber) {
      const double packet = monitor_.packet_bytes();
      if (outcome->good)
        monitor_.arrived(outcome->time_s, rtt_s_, packet + moved_bytes() - moved_before_);
      else
        monitor_.lost();
      continue;
    }
    if (const auto it = under_way_.find(outcome->number); it != under_way_.end()) {
      const double come = outcome->good ? it->second.bytes : inner_.received(outcome->number);
      ended_bytes_ += std::max(0.0, come - it->second.before);
      under_way_.erase(it);
    }
    return outcome;
  }
}

SimulationResult simulate_with_probes(const std::vector<FragmentOffer>& offers, const HtcOptions& options,
                                      const NetworkOptions& network, const ProbeOptions& probe,
                                      ProbeResult& result) {
  BandwidthMonitor monitor(probe);
  std::optional<MonitoredTransport> monitored;
  SimulationResult out = simulate(offers, options, network, [&](Transport& model) -> Transport& {
    return monitored.emplace(model, monitor, network.rtt_s);
  });
  result = {monitor.samples(), monitor.sent(), monitor.sent_bytes()};
  return out;
}

}  // namespace texmesh
