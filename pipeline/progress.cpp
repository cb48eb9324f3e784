#include "pipeline/progress.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <numeric>
#include <ostream>

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

/// Shares of a model's time that the stages took on the sample scans; they only shape the progress bar.
double share(const std::string& stage) {
  static const std::map<std::string, double> shares{{"import", .03},         {"condition", .04},
                                                    {"skeletonization", .2}, {"ssf", .2},
                                                    {"simplification", .15}, {"perceptual_values", .05},
                                                    {"fragmentation", .03},  {"zim", .02},
                                                    {"ladder", .08},         {"lut", .08},
                                                    {"scales", .05},         {"quality", .06},
                                                    {"package", .01}};
  const auto it = shares.find(stage);
  return it == shares.end() ? 0 : it->second;
}

const char* result_name(ModelResult r) {
  switch (r) {
    case ModelResult::kOk:
      return "ok";
    case ModelResult::kUnchanged:
      return "unchanged";
    case ModelResult::kFailed:
      return "failed";
    case ModelResult::kInternal:
      return "internal-error";
    default:
      return "cancelled";
  }
}

std::string sentence(const Json& note) {
  const std::string place = note.value("place", "");
  return note.value("code", "") + (place.empty() ? "" : " at " + place) + ": " + note.value("text", "");
}

}  // namespace

std::string format_bytes(std::uint64_t bytes) {
  if (bytes < 1000) return fmt::format("{} B", bytes);
  if (bytes < 1000000) return fmt::format("{:.1f} kB", static_cast<double>(bytes) / 1e3);
  if (bytes < 1000000000) return fmt::format("{:.2f} MB", static_cast<double>(bytes) / 1e6);
  return fmt::format("{:.2f} GB", static_cast<double>(bytes) / 1e9);
}

std::string format_seconds(double seconds) {
  if (seconds < 60) return fmt::format("{:.1f} s", seconds);
  const int s = static_cast<int>(seconds + .5);
  if (s < 3600) return fmt::format("{} min {} s", s / 60, s % 60);
  return fmt::format("{} h {} min", s / 3600, s / 60 % 60);
}

Progress::Progress(std::ostream& out, OutputMode mode, std::vector<std::string> models, bool verbose)
    : out_(out), mode_(mode), models_(std::move(models)), verbose_(verbose), fraction_(models_.size()) {}

void Progress::started(std::size_t job, const std::string& output) {
  if (mode_ == OutputMode::kJson)
    out_ << Json{{"event", "model-started"}, {"model", models_[job]}, {"output", output}}.dump() << '\n'
         << std::flush;
}

void Progress::event(std::size_t job, const std::string& json_line) {
  Json e = Json::parse(json_line, nullptr, false);
  if (!e.is_object()) return;
  const std::string event = e.value("event", "");
  if (mode_ == OutputMode::kJson) {
    Json tagged{{"event", event}, {"model", models_[job]}};
    for (const auto& [k, v] : e.items())
      if (k != "event") tagged[k] = v;
    out_ << tagged.dump() << '\n' << std::flush;
    return;
  }
  const std::string stage = e.value("stage", "");
  if (event == "stage-started") {
    running_[job] = stage;
  } else if (event == "stage-finished") {
    fraction_[job] += share(stage);
    if (verbose_ && e.value("result", "") == "ran")
      line(fmt::format("{}: {} took {}", models_[job], stage, format_seconds(e.value("seconds", 0.0))));
    else if (verbose_)
      line(fmt::format("{}: {} from the cache", models_[job], stage));
  } else if (event == "note" && (e.value("severity", "") == "warning" || verbose_)) {
    line(fmt::format("{}: {}: {}", models_[job], e.value("severity", "") == "warning" ? "warning" : "note",
                     sentence(e)));
  } else if (event == "error") {
    line(fmt::format("error: {}", e.value("message", "")));
  }
  redraw();
}

void Progress::finished(std::size_t job, const WorkerReport& r, const std::string& output) {
  ++finished_count_;
  running_.erase(job);
  fraction_[job] = 1;
  if (mode_ == OutputMode::kJson) {
    out_ << Json{{"event", "model-finished"},
                 {"model", models_[job]},
                 {"result", result_name(r.result)},
                 {"output", output},
                 {"bytes", r.package_bytes},
                 {"seconds", r.seconds},
                 {"peak_memory_bytes", r.peak_memory_bytes},
                 {"stages_ran", r.stages_ran},
                 {"stages_from_cache", r.stages_hit}}
                .dump()
         << '\n'
         << std::flush;
    return;
  }
  if (r.result == ModelResult::kOk && mode_ != OutputMode::kQuiet)
    line(fmt::format("{}: {}, {}, {}, peak memory {}{}", models_[job], output, format_bytes(r.package_bytes),
                     format_seconds(r.seconds), format_bytes(r.peak_memory_bytes),
                     r.stages_hit ? fmt::format(" ({} of {} stages from the cache)", r.stages_hit,
                                                r.stages_hit + r.stages_ran)
                                  : ""));
  else if (r.result == ModelResult::kUnchanged && mode_ != OutputMode::kQuiet)
    line(fmt::format("{}: {} is up to date", models_[job], output));
  redraw();
}

void Progress::summary(const std::vector<WorkerReport>& reports, double seconds) {
  auto count = [&](ModelResult r) {
    return std::count_if(reports.begin(), reports.end(),
                         [r](const WorkerReport& x) { return x.result == r; });
  };
  const auto ok = count(ModelResult::kOk), same = count(ModelResult::kUnchanged),
             cancelled = count(ModelResult::kCancelled);
  const auto failed = static_cast<std::ptrdiff_t>(reports.size()) - ok - same - cancelled;
  if (mode_ == OutputMode::kTerminal) out_ << "\r\033[K" << std::flush;
  if (mode_ == OutputMode::kJson) {
    out_ << Json{{"event", "summary"}, {"models", reports.size()}, {"compiled", ok},    {"unchanged", same},
                 {"failed", failed},   {"cancelled", cancelled},   {"seconds", seconds}}
                .dump()
         << '\n'
         << std::flush;
    return;
  }
  if (reports.size() < 2 && cancelled == 0) return;
  if (mode_ != OutputMode::kQuiet || failed + cancelled > 0)
    out_ << fmt::format("{} compiled, {} up to date, {} failed{} in {}\n", ok, same, failed,
                        cancelled ? fmt::format(", {} cancelled", cancelled) : "", format_seconds(seconds))
         << std::flush;
}

void Progress::line(const std::string& text) {
  out_ << (mode_ == OutputMode::kTerminal ? "\r\033[K" : "") << text << '\n' << std::flush;
}

double Progress::done_fraction() const {
  const double sum = std::accumulate(fraction_.begin(), fraction_.end(), 0.0);
  return std::min(1.0, sum / static_cast<double>(std::max<std::size_t>(fraction_.size(), 1)));
}

std::string Progress::eta() const {
  const double done = done_fraction();
  const double elapsed = std::chrono::duration<double>(std::chrono::steady_clock::now() - start_).count();
  if (done < .02 || elapsed < 1) return "";
  return ", " + format_seconds(elapsed * (1 - done) / done) + " left";
}

void Progress::redraw() {
  if (mode_ != OutputMode::kTerminal) return;
  constexpr int kWidth = 24;
  const int filled = static_cast<int>(done_fraction() * kWidth);
  std::string now;
  for (const auto& [job, stage] : running_) {
    now = models_[job] + " " + stage;
    break;
  }
  out_ << fmt::format("\r\033[K[{:=<{}}{:<{}}] {}/{} {}{}", "", filled, "", kWidth - filled, finished_count_,
                      models_.size(), now, eta())
       << std::flush;
}

}  // namespace texmesh
