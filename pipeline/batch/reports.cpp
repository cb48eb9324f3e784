#include "pipeline/batch/reports.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

std::string dump(const Json& j) { return j.dump(1, ' ', false, Json::error_handler_t::replace) + "\n"; }

double microseconds(double s) { return std::round(s * 1e6); }

Json span(const std::string& name, const char* category, double start_s, double end_s, int process,
          int thread) {
  return {{"name", name},
          {"cat", category},
          {"ph", "X"},
          {"ts", microseconds(start_s)},
          {"dur", std::max(1.0, microseconds(end_s - start_s))},
          {"pid", process},
          {"tid", thread}};
}

Json named(const char* what, int process, int thread, const std::string& name) {
  return {{"name", what}, {"ph", "M"}, {"pid", process}, {"tid", thread}, {"args", {{"name", name}}}};
}

/// Stages of a model overlap; each goes to the first thread that is free at its start.
std::vector<int> threads_of(const std::vector<StageSpan>& spans) {
  std::vector<double> free_at;
  std::vector<int> thread;
  for (const StageSpan& s : spans) {
    std::size_t t = 0;
    while (t < free_at.size() && free_at[t] > s.start_s) ++t;
    if (t == free_at.size()) free_at.push_back(0);
    free_at[t] = s.end_s;
    thread.push_back(static_cast<int>(t) + 1);
  }
  return thread;
}

}  // namespace

std::string write_trace(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports) {
  Json events = Json::array();
  std::map<int, int> lanes;  // most threads of stages
  for (std::size_t i = 0; i < models.size(); ++i) {
    const WorkerReport& r = reports[i];
    if (!r.ran) continue;
    lanes.try_emplace(r.lane, 0);
    events.push_back(
        span(std::string(models[i].name()), "model", r.start_s, r.start_s + r.seconds, r.lane, 0));
    const std::vector<int> threads = threads_of(r.more->spans);
    for (std::size_t k = 0; k < r.more->spans.size(); ++k) {
      const StageSpan& s = r.more->spans[k];
      events.push_back(span(s.stage, s.hit ? "hit" : "stage", s.start_s, s.end_s, r.lane, threads[k]));
      lanes[r.lane] = std::max(lanes[r.lane], threads[k]);
    }
  }
  for (const auto& [lane, threads] : lanes) {
    events.push_back(named("process_name", lane, 0, "worker " + std::to_string(lane)));
    events.push_back(named("thread_name", lane, 0, "models"));
    for (int t = 1; t <= threads; ++t)
      events.push_back(named("thread_name", lane, t, "stages " + std::to_string(t)));
  }
  return dump(Json{{"displayTimeUnit", "ms"}, {"traceEvents", std::move(events)}});
}

std::string write_statistics(const std::vector<WorkerReport>& reports) {
  struct Row {
    int ran = 0, hits = 0;
    double seconds = 0;
  };
  std::vector<std::string> order;  // of first appearance, which is about that of the graph
  std::map<std::string, Row> rows;
  Row all;
  for (const WorkerReport& r : reports)
    for (const StageSpan& s : r.more->spans) {
      if (!rows.contains(s.stage)) order.push_back(s.stage);
      for (Row* row : {&rows[s.stage], &all}) {
        ++(s.hit ? row->hits : row->ran);
        row->seconds += s.end_s - s.start_s;
      }
    }
  std::string out = fmt::format("{:<20} {:>7} {:>11} {:>10}\n", "stage", "ran", "from cache", "seconds");
  for (const std::string& stage : order)
    out += fmt::format("{:<20} {:>7} {:>11} {:>10.2f}\n", stage, rows[stage].ran, rows[stage].hits,
                       rows[stage].seconds);
  const auto not_run =
      std::count_if(reports.begin(), reports.end(), [](const WorkerReport& r) { return !r.ran; });
  return out + fmt::format("{:<20} {:>7} {:>11} {:>10.2f}\n{} of {} models needed no look at their stages\n",
                           "all", all.ran, all.hits, all.seconds, not_run, reports.size());
}

}  // namespace texmesh
