#include "delivery/cpp/simulate/link_recorder.h"

#include <algorithm>
#include <charconv>

namespace texmesh {
namespace {

// A step that was busy for less says too little: it goes with the next one.
constexpr double kLeastBusy = 0.25;
constexpr std::size_t kMostSteps = 1'000'000;

/// Gathers stretches of time with the bytes that came in them into steps.
class TraceSteps {
 public:
  explicit TraceSteps(double step_s) : step_s_(step_s) {}
  /// A stretch in which the link has carried `bytes` evenly. One of no length adds its bytes.
  void add(double from_s, double to_s, double bytes) {
    double left_s = to_s - from_s;
    while (left_s > 0) {
      const double end_s = std::min(to_s, std::max(begin_s_ + step_s_, from_s));
      const double part_s = std::min(left_s, std::max(end_s - from_s, 0.0));
      if (part_s > 0) {
        const double part = bytes * (part_s / left_s);
        busy_s_ += part_s;
        bytes_ += part;
        bytes -= part;
        from_s += part_s;
        left_s -= part_s;
      }
      if (left_s > 0) close(from_s);
    }
    bytes_ += bytes;
  }
  BandwidthTrace finish() {
    if (busy_s_ >= kLeastBusy * step_s_ || trace_.time_s.empty()) push();
    while (trace_.bytes_s.size() > 1 && trace_.bytes_s.back() <= 0) {
      trace_.time_s.pop_back();
      trace_.bytes_s.pop_back();
    }
    return std::move(trace_);
  }

 private:
  void close(double now_s) {
    if (busy_s_ >= kLeastBusy * step_s_) {
      push();
      begin_s_ = now_s;
      busy_s_ = bytes_ = 0;
    } else {
      begin_s_ = std::max(begin_s_, now_s - busy_s_);  // it goes on from here
    }
  }
  void push() {
    trace_.time_s.push_back(trace_.time_s.empty() ? 0 : begin_s_);
    trace_.bytes_s.push_back(bytes_ / std::max(busy_s_, 1e-4));
  }
  double step_s_, begin_s_ = 0, busy_s_ = 0, bytes_ = 0;
  BandwidthTrace trace_{{}, {}};
};

}  // namespace

void LinkRecorder::add(Kind kind, double time_s, double bytes) {
  if (!events_.empty()) time_s = std::max(time_s, events_.back().time_s);
  events_.push_back({kind, time_s, bytes});
  bytes_ += bytes;
}
void LinkRecorder::asked(double time_s) { add(Kind::kAsked, time_s, 0); }
void LinkRecorder::received(double time_s, double bytes) { add(Kind::kBytes, time_s, bytes); }
void LinkRecorder::ended(double time_s) { add(Kind::kEnded, time_s, 0); }

std::optional<BandwidthTrace> LinkRecorder::trace(double rtt_s, double step_s) const {
  if (bytes_ <= 0) return std::nullopt;
  const double start_s = events_.front().time_s, span_s = events_.back().time_s - start_s;
  TraceSteps steps(std::max(step_s, span_s / kMostSteps));
  int under_way = 0;
  double carries_from_s = 0;
  for (const Event& e : events_) {
    const double now_s = e.time_s - start_s;
    if (e.kind == Kind::kAsked && under_way++ == 0) carries_from_s = now_s + rtt_s;
    if (e.kind == Kind::kEnded) under_way = std::max(0, under_way - 1);
    if (e.kind != Kind::kBytes) continue;
    steps.add(std::min(carries_from_s, now_s), now_s, e.bytes);
    carries_from_s = now_s;
  }
  return steps.finish();
}

std::string trace_csv(const BandwidthTrace& trace, const std::string& comment) {
  std::string csv;
  for (std::size_t at = 0; at < comment.size();) {
    const std::size_t end = std::min(comment.find('\n', at), comment.size());
    csv += "# " + comment.substr(at, end - at) + '\n';
    at = end + 1;
  }
  csv += "seconds,bytes per second\n";
  const auto append = [&](double value, char last) {
    char text[32];
    const auto end = std::to_chars(text, text + sizeof text, value);
    csv.append(text, end.ptr);
    csv += last;
  };
  for (std::size_t i = 0; i < trace.time_s.size(); ++i) {
    append(trace.time_s[i], ',');
    append(trace.bytes_s[i], '\n');
  }
  return csv;
}

}  // namespace texmesh
