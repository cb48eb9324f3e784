#pragma once
#include <chrono>
#include <memory>
#include <string>
#include <vector>

#include "delivery/cpp/client/texture_loader.h"
#include "delivery/cpp/package/http_store.h"
#include "delivery/cpp/simulate/link_recorder.h"
#include "delivery/cpp/transfer/monitored_transport.h"
#include "tools/cli/fetch/link_history.h"

namespace texmesh {

/// What `fetch` learns of the link beside the package: a recording, test packets, and the average of each
/// host from run to run. Each of them only where it is asked for.
class LinkWatch {
 public:
  /// `record`: file for a trace, `history`: file of averages, or "state" for the user's; "" = none. Throws
  /// InputError for a recording that could not be written. A history that cannot be read gives problem() and
  /// is left as it is.
  LinkWatch(std::string record, std::string history, const ProbeOptions& probe);
  /// The options with the recorder in them.
  HttpOptions watched(HttpOptions http);
  /// beta_0: the historic average of the host, as far as it lies within a factor of 2 of what this load has
  /// shown.
  double beta0(const std::string& url, double shown_bytes_s) const;
  /// `inner` with test packets, ranges of the package's largest file; `inner` itself where none are wanted,
  /// or where there is no network behind it.
  Transport& monitored(Transport& inner, PackageReader& package, bool network, double rtt_s);
  /// Writes what is to be kept. `urls`: in the order of the load's mirrors. `bytes_s`: of the whole load.
  void finish(const std::vector<std::string>& urls, const LoadReport& load, double rtt_s, double bytes_s);

  const BandwidthMonitor& monitor() const { return monitor_; }
  bool probes() const { return probe_.mode != ProbeMode::kOff; }
  std::size_t recorded_steps() const { return recorded_steps_; }
  const std::string& problem() const { return problem_; }

 private:
  double now_s() const;
  std::string record_, history_path_, problem_;
  ProbeOptions probe_;
  BandwidthMonitor monitor_;
  LinkRecorder recorder_;
  LinkHistory history_;
  std::unique_ptr<MonitoredTransport> transport_;
  std::chrono::steady_clock::time_point start_ = std::chrono::steady_clock::now();
  std::size_t recorded_steps_ = 0;
};

}  // namespace texmesh
