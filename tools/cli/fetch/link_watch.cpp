#include "tools/cli/fetch/link_watch.h"

#include <fmt/format.h>
#include <algorithm>

#include "format/base/errors.h"
#include "format/base/text_bytes.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {
namespace {

constexpr double kRecordStep_s = 0.05;
constexpr double kTrusted = 2;  // a history farther from what is seen is of another link

/// The largest file of the package's textures.
EntryRef largest_pack(PackageReader& package) {
  EntryRef largest;
  for (const TextureInfo& t : package.textures())
    for (const EntryRef& rung : t.rungs)
      if (rung.bytes > largest.bytes) largest = rung;
  return largest;
}

}  // namespace

LinkWatch::LinkWatch(std::string record, std::string history, const ProbeOptions& probe)
    : record_(std::move(record)), probe_(probe), monitor_(probe) {
  if (!record_.empty()) check_output_file(record_);
  if (history.empty()) return;
  history_path_ = history == "state" ? default_link_history() : history;
  try {
    history_ = LinkHistory::read(history_path_);
  } catch (const InputError& e) {
    problem_ = e.what();
    history_path_.clear();
  }
}

double LinkWatch::now_s() const {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
}

HttpOptions LinkWatch::watched(HttpOptions http) {
  if (record_.empty()) return http;
  http.on_traffic = [this](const HttpTraffic& t) {
    switch (t.kind) {
      case HttpTraffic::Kind::kAsked:
        recorder_.asked(now_s());
        break;
      case HttpTraffic::Kind::kBytes:
        recorder_.received(now_s(), static_cast<double>(t.bytes));
        break;
      case HttpTraffic::Kind::kEnded:
        recorder_.ended(now_s());
        break;
    }
  };
  return http;
}

double LinkWatch::beta0(const std::string& url, double shown_bytes_s) const {
  const auto average = history_.average_bytes_s(host_of_url(url));
  return average ? std::clamp(*average, shown_bytes_s / kTrusted, shown_bytes_s * kTrusted) : shown_bytes_s;
}

Transport& LinkWatch::monitored(Transport& inner, PackageReader& package, bool network, double rtt_s) {
  const EntryRef pack = probes() && network ? largest_pack(package) : EntryRef{};
  if (pack.bytes == 0) return inner;
  transport_ = std::make_unique<MonitoredTransport>(
      inner, monitor_, rtt_s, [pack](std::uint64_t bytes, std::uint32_t nth) -> std::vector<PackagePart> {
        if (bytes > pack.bytes) return {};
        const std::uint64_t places = pack.bytes - bytes + 1;
        return {{pack, {nth * bytes % places, bytes}}};
      });
  return *transport_;
}

void LinkWatch::finish(const std::vector<std::string>& urls, const LoadReport& load, double rtt_s,
                       double bytes_s) {
  if (transport_) transport_->stop();
  if (!record_.empty()) {
    const auto trace = recorder_.trace(rtt_s, kRecordStep_s);
    if (!trace) throw InputError(record_, "", "bytes to record", "none");
    recorded_steps_ = trace->time_s.size();
    const std::string csv =
        trace_csv(*trace, fmt::format("recorded by texmesh fetch: {:.0f} bytes; round trip {:.1f} ms",
                                      recorder_.bytes(), 1000 * rtt_s));
    write_output_file(record_, text_bytes(csv));
  }
  if (history_path_.empty()) return;
  const bool several = load.mirrors.size() > 1;
  for (std::size_t i = 0; i < urls.size(); ++i) {
    if (!several && i > 0) break;
    if (several && (i >= load.mirrors.size() || load.mirrors[i].requests == 0)) continue;
    history_.add(host_of_url(urls[i]), several ? load.mirrors[i].bytes_s : bytes_s);
  }
  history_.write(history_path_);
}

}  // namespace texmesh
