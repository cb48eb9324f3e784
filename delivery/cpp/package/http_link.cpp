#include "delivery/cpp/package/http_link.h"

#include <algorithm>
#include <chrono>
#include <thread>

namespace texmesh {
namespace {

constexpr int kConnections = 6;  // as browsers have
constexpr int kStallTries = 2;   // what a try costs that ended with silence
constexpr double kSlice_s = 0.1;

}  // namespace

bool HttpRetries::wait(const HttpAnswer& last) {
  left_ -= last.timed_out ? kStallTries : 1;
  if (left_ < 0) return false;
  double s = std::min(std::max(delay_s_, last.retry_after_s), options_.most_retry_delay_s);
  for (; s > 0; s -= kSlice_s) {
    if (options_.cancelled && options_.cancelled()) return false;
    std::this_thread::sleep_for(std::chrono::duration<double>(std::min(s, kSlice_s)));
  }
  delay_s_ *= 2;
  return true;
}

HttpLink::HttpLink(const HttpOptions& o) : options(o), pool(o, kConnections) {}

}  // namespace texmesh
