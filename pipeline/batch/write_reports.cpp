// What a run leaves beside its packages: a trace, statistics, a dependency file, and the summaries.
#include "pipeline/batch/run.h"

#include <fmt/format.h>

#include <filesystem>
#include <iostream>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/batch/fleet/model_list.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/compile/options.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

double microseconds(double s) { return std::round(s * 1e6); }

struct TraceName {
  std::string name;
  static void fields(auto& s, auto&& v) { v("name", s.name, ""); }
};
/// A span of time, or the name of a process or a thread.
struct TraceEvent {
  std::string name;
  std::optional<std::string> category = {};
  std::string phase;
  std::optional<double> start_us = {}, duration_us = {};
  int process = 0, thread = 0;
  std::optional<TraceName> named = {};
  static void fields(auto& s, auto&& v) {
    v("name", s.name, "");
    v("cat", s.category, "");
    v("ph", s.phase, "");
    v("ts", s.start_us, "");
    v("dur", s.duration_us, "");
    v("pid", s.process, "");
    v("tid", s.thread, "");
    v("args", s.named, "");
  }
};
struct Trace {
  std::string unit = "ms";
  std::vector<TraceEvent> events;
  static void fields(auto& s, auto&& v) {
    v("displayTimeUnit", s.unit, "");
    v("traceEvents", s.events, "");
  }
};

TraceEvent span(const std::string& name, const char* category, double start_s, double end_s, int process,
                int thread) {
  return {name,    category, "X", microseconds(start_s), std::max(1.0, microseconds(end_s - start_s)),
          process, thread};
}

TraceEvent named(const char* what, int process, int thread, const std::string& name) {
  return {.name = what, .phase = "M", .process = process, .thread = thread, .named = TraceName{name}};
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

// What one of them takes for something else, or Ninja for the end of a path, and nothing can prevent it.
constexpr std::string_view kNotForBoth = ";|=%*?'&\t\n\r";

/// What both accept (GNU make 4.3, Ninja 1.11): "\ " for a blank, "\#", "\:", "$$"; everything else as it is.
std::string depfile_escaped(const std::string& path) {
  std::string out;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const char c = path[i];
    if (kNotForBoth.find(c) != std::string_view::npos)
      throw InputError(
          path, "",
          "a path without ; | = % * ? ' & tabs and line breaks (no dependency file holds them for "
          "both make and Ninja)",
          c < ' ' ? "one with a control character" : std::string("one with ") + c);
    if ((c == ' ' || c == '#' || c == ':') && i > 0 && path[i - 1] == '\\')
      throw InputError(path, "",
                       "a path without a backslash before a blank, # or : (dependency files cannot hold it)",
                       "one with it");
    if (c == ' ' || c == '#' || c == ':') out += '\\';
    if (c == '$') out += '$';
    out += c;
  }
  return out;
}

/// What is not there may have any name.
bool can_be_dependency(const std::string& path) {
  try {
    depfile_escaped(path);
    return true;
  } catch (const InputError&) {
    return false;
  }
}

void write_text(const std::string& path, const std::string& text) {
  if (path.empty()) return;
  if (is_special_file(path)) return write_output_file(path, text_bytes(text));
  remove_stale_temporaries(fs::path(path).parent_path().string(), fs::path(path).filename().string());
  if (!file_holds(path, text_bytes(text))) write_output_file(path, text_bytes(text));
}

std::vector<std::string> dependencies(const BatchPlan& plan, const RunSettings& settings,
                                      const WorkerReport& report) {
  const fs::path folder = fs::path(plan.models[0].input).parent_path();
  std::vector<std::string> all;
  for (const FileRequest& f : report.more->files) {
    if (f.similar) continue;
    const std::string path = f.uri.empty() ? plan.models[0].input : (folder / f.uri).string();
    if (f.found || can_be_dependency(path)) all.push_back(path);
  }
  all.insert(all.end(), settings.more_inputs.begin(), settings.more_inputs.end());
  return all;
}

}  // namespace

std::string write_trace(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports) {
  Trace trace;
  std::map<int, int> lanes;  // most threads of stages
  for (std::size_t i = 0; i < models.size(); ++i) {
    const WorkerReport& r = reports[i];
    if (!r.ran) continue;
    lanes.try_emplace(r.lane, 0);
    trace.events.push_back(
        span(std::string(models[i].name()), "model", r.start_s, r.start_s + r.seconds, r.lane, 0));
    const std::vector<int> threads = threads_of(r.more->spans);
    for (std::size_t k = 0; k < r.more->spans.size(); ++k) {
      const StageSpan& s = r.more->spans[k];
      trace.events.push_back(span(s.stage, s.hit ? "hit" : "stage", s.start_s, s.end_s, r.lane, threads[k]));
      lanes[r.lane] = std::max(lanes[r.lane], threads[k]);
    }
  }
  for (const auto& [lane, threads] : lanes) {
    trace.events.push_back(named("process_name", lane, 0, "worker " + std::to_string(lane)));
    trace.events.push_back(named("thread_name", lane, 0, "models"));
    for (int t = 1; t <= threads; ++t)
      trace.events.push_back(named("thread_name", lane, t, "stages " + std::to_string(t)));
  }
  return to_json_line(trace) + "\n";
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
  return out +
         fmt::format("{:<20} {:>7} {:>11} {:>10.2f}\n{} of {} models were skipped: nothing had changed\n",
                     "all", all.ran, all.hits, all.seconds, not_run, reports.size());
}

std::string write_depfile(const std::string& target, const std::vector<std::string>& dependencies) {
  std::string text = depfile_escaped(target) + ":";
  for (const std::string& d : dependencies) text += " \\\n  " + depfile_escaped(d);
  text += "\n";
  for (const std::string& d : dependencies) text += "\n" + depfile_escaped(d) + ":\n";
  return text;
}

void check_reports(const BatchPlan& plan, const RunSettings& settings) {
  for (const std::string* path : {&settings.summary, &settings.junit, &settings.trace, &settings.depfile})
    if (!path->empty()) check_output_file(*path);
  if (!settings.depfile.empty()) write_depfile(plan.models.at(0).output, {plan.models[0].input});
}

bool write_reports(const BatchPlan& plan, const RunSettings& settings,
                   const std::vector<WorkerReport>& reports, double seconds) {
  bool all_written = true;
  const auto write = [&](const std::string& path, auto&& text) {
    try {
      if (!path.empty()) write_text(path, text());
    } catch (const InputError& e) {
      std::cerr << "texmesh compile: " << e.what() << '\n';
      all_written = false;
    }
  };
  write(settings.summary, [&] { return write_summary(summarize_run(plan, reports, seconds)); });
  write(settings.junit, [&] { return write_junit(summarize_run(plan, reports, seconds)); });
  write(settings.trace, [&] { return write_trace(plan.models, reports); });
  if (settings.statistics && settings.mode != OutputMode::kJson) std::cout << write_statistics(reports);
  if (!settings.depfile.empty() && reports[0].ok())
    write(settings.depfile,
          [&] { return write_depfile(plan.models[0].output, dependencies(plan, settings, reports[0])); });
  return all_written;
}

std::vector<DocumentSchema> pipeline_schemas() {
  return {profile_schema(), jnd_profile_schema(), event_schema(), summary_schema(), list_schema()};
}

}  // namespace texmesh
