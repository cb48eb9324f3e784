#pragma once
#include <algorithm>

#include "delivery/cpp/client/delivery_plan.h"

namespace texmesh {

/// The request's policy for the textures: `left_s` seconds are left for them. `shown_bytes_s`, what transfers
/// before them have shown, is the first guess of the throughput unless the request has one.
inline HtcOptions request_htc(const DeliveryRequest& request, double left_s, double shown_bytes_s) {
  HtcOptions htc = request.htc;
  htc.time_limit_s = left_s;
  htc.rtt_s = request.network.rtt_s;
  htc.sites = static_cast<int>(std::clamp<std::size_t>(request.network.mirrors.size(), 1, 64));
  htc.throughput.initial_bytes_s = request.beta0_bytes_s > 0 ? request.beta0_bytes_s : shown_bytes_s;
  return htc;
}

}  // namespace texmesh
