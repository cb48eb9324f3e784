#pragma once
#include <cstdint>

#include "delivery/cpp/http/http_client.h"

namespace texmesh {

// Shared by the readers of one package over HTTP; no interface.

inline constexpr double kRequestWait_s = 3600;         // the pool's own limits end requests sooner
inline constexpr std::uint64_t kProgressBytes = 1024;  // a try that brings as many is not counted

/// Counts the tries of one request and waits longer from one to the next.
class HttpRetries {
 public:
  explicit HttpRetries(const HttpOptions& options)
      : options_(options), left_(options.retries), delay_s_(options.retry_delay_s) {}
  /// Waits before the next try; false when there have been enough.
  bool wait(const HttpAnswer& last);

 private:
  HttpOptions options_;
  int left_;
  double delay_s_;
};

/// What all that read from one set of servers share.
struct HttpLink {
  explicit HttpLink(const HttpOptions& o);
  HttpOptions options;
  HttpPool pool;
};

}  // namespace texmesh
