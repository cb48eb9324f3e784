#include "delivery/cpp/transfer/monitored_transport.h"

#include <algorithm>

namespace texmesh {

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
  const std::uint32_t nth = monitor_.sent();
  TransferRequest request{kPacketNumber, monitor_.send(now_s()), {}};
  if (packet_) request.parts = packet_(request.bytes, nth);
  if (packet_ && request.parts.empty()) {
    monitor_.lost();
    return;
  }
  moved_before_ = moved_bytes();
  packet_under_way_ = true;
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
      packet_under_way_ = false;
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

void MonitoredTransport::stop() {
  if (!packet_under_way_) return;
  packet_under_way_ = false;
  inner_.cancel(kPacketNumber);
  monitor_.lost();
}

}  // namespace texmesh
