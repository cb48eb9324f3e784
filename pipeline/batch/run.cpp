#include "pipeline/batch/run.h"

#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <ostream>
#include <set>

#include "format/base/errors.h"
#include "format/documents/allocation.h"
#include "pipeline/batch/build_memo.h"
#include "pipeline/batch/depfile.h"
#include "pipeline/batch/reports.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/core_path.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

std::span<const std::uint8_t> bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

/// What a model costs that was never compiled: measured on the sample scans, rounded up.
constexpr std::uint64_t kBaseMemory_bytes = 300'000'000, kMemoryPerByte = 10;
constexpr double kBaseSeconds = 1, kSecondsPerByte = 5e-7;

class Batch {
 public:
  /// `cache_problem`: why there is no cache folder though one was asked for.
  Batch(const BatchPlan& plan, const RunSettings& settings, std::ostream& out, std::string cache_problem)
      : plan_(plan),
        settings_(settings),
        memo_(settings.cache.folder, plan.outputs),
        reports_(plan.models.size()),
        records_(plan.models.size()),
        progress_(out, settings.mode, settings.verbose, settings.explain || settings.dry_run),
        cache_problem_(std::move(cache_problem)) {}

  int run() {
    request_seed_ = tool_seed();
    select();
    if (settings_.dry_run) return forecast();
    make_folders();
    remove_leftovers();
    compile();
    write_reports();
    if (wrote_ && !was_cancelled() && !settings_.cache.folder.empty())
      prune_now_and_then(settings_.cache.folder, settings_.cache_limits);
    return exit_code();
  }

 private:
  /// Another build of the tool looks at every model again; the cache then says what has really changed.
  std::string tool_seed() const {
    const auto stamp = stamp_of(core_executable());
    return stamp ? std::to_string(stamp->inode) + " " + std::to_string(stamp->bytes) + " " +
                       std::to_string(stamp->modified_ns)
                 : "";
  }

  const Sha256& request_of(const std::shared_ptr<const std::string>& profile) {
    const auto [it, fresh] = requests_.try_emplace(profile.get());
    if (fresh) {
      Key key("compile", 1);
      key.add("tool", request_seed_).add("profile", *profile).add("strict", settings_.strict ? "1" : "0");
      it->second = key.digest();
    }
    return it->second;
  }

  /// Splits the plan into what is known and what must run.
  void select() {
    for (std::size_t i = 0; i < plan_.models.size(); ++i) {
      const PlannedModel& m = plan_.models[i];
      MemoRecord& record = records_[i];
      const bool remembered = memo_.find(m.output, record);
      bool refreshed = false;
      if (remembered && record.request == request_of(m.profile) &&
          !(record.failed && settings_.retry_failed) && still_holds(record, m.input, m.output, refreshed)) {
        if (refreshed) memo_.set(m.output, record);
        recall(i, record);
        record = {};
        continue;
      }
      add_job(i, remembered);
    }
  }

  void recall(std::size_t i, const MemoRecord& record) {
    WorkerReport& r = reports_[i];
    failure_recalled_ = failure_recalled_ || record.failed;
    r.result = record.failed ? ModelResult::kFailed : ModelResult::kUnchanged;
    r.package_bytes = record.package_bytes;
    if (!settings_.depfile.empty()) r.files = record.files;
    if (record.failed && record.error.size() == 6) {
      r.error_kind = record.error[0];
      r.error_file = record.error[1];
      r.error_place = record.error[2];
      r.error_expected = record.error[3];
      r.error_found = record.error[4];
      r.error_message = record.error[5];
    }
  }

  void add_job(std::size_t i, bool remembered) {
    const PlannedModel& m = plan_.models[i];
    MemoRecord& record = records_[i];
    WorkerJob job;
    job.input = m.input;
    job.output = m.output;
    job.profile = m.profile;
    job.cache = settings_.cache;
    job.strict = settings_.strict;
    job.explain = settings_.explain;
    job.forecast = settings_.dry_run;
    if (remembered) {
      for (FileRequest& f : record.files)
        if (f.found && f.stamp.is_settled(record.looked_at_ns)) job.known.push_back(std::move(f));
      job.earlier_keys = std::move(record.keys);
      record.files = {};  // of 100,000 models there is no room for both
      record.keys = {};
    }
    if (remembered && record.peak_memory_bytes > 0) {
      job.predicted_memory_bytes = record.peak_memory_bytes;
      job.predicted_s = record.seconds;
    } else {
      std::error_code ec;
      const auto size = fs::file_size(m.input, ec);
      const std::uint64_t bytes = ec ? 0 : size;
      job.predicted_memory_bytes = kBaseMemory_bytes + kMemoryPerByte * bytes;
      job.predicted_s = kBaseSeconds + kSecondsPerByte * static_cast<double>(bytes);
    }
    jobs_.push_back(std::move(job));
    model_of_job_.push_back(i);
  }

  void make_folders() const {
    std::set<std::string> made;
    for (const WorkerJob& job : jobs_) {
      const std::string folder = fs::path(job.output).parent_path().string();
      if (folder.empty() || !made.insert(folder).second) continue;
      std::error_code ec;
      fs::create_directories(folder, ec);
      if (ec) throw InputError(folder, "", "an output folder", ec.message());
    }
  }

  /// What killed runs have left beside the packages.
  void remove_leftovers() const {
    std::set<std::string> folders;
    for (const PlannedModel& m : plan_.models) folders.insert(fs::path(m.output).parent_path().string());
    for (const std::string& folder : folders) remove_stale_temporaries(folder, ".texmesh");
  }

  void begin_progress() {
    std::vector<ProgressModel> models;
    for (std::size_t i = 0; i < plan_.models.size(); ++i) models.push_back({plan_.models[i].name, 0});
    for (std::size_t j = 0; j < jobs_.size(); ++j) models[model_of_job_[j]].weight = jobs_[j].predicted_s;
    progress_.begin(std::move(models));
    if (!cache_problem_.empty()) progress_.cache_event("cache-not-written", cache_problem_);
    if (memo_.was_damaged())
      progress_.cache_event("cache-entry-damaged",
                            "what earlier runs found out does not have its digest; every model is looked at");
    std::size_t next = 0;
    for (std::size_t i = 0; i < plan_.models.size(); ++i) {
      if (next < model_of_job_.size() && model_of_job_[next] == i)
        ++next;
      else
        progress_.recalled(i, reports_[i], plan_.models[i].output);
    }
  }

  void compile() {
    begin_progress();
    std::vector<bool> announced(jobs_.size());
    auto saved = Clock::now();
    const auto on_event = [&](std::size_t job, const std::string& line) {
      const std::size_t i = model_of_job_[job];
      if (!announced[job]) progress_.started(i, jobs_[job].output);
      announced[job] = true;
      progress_.event(i, line);
    };
    const auto on_finish = [&](std::size_t job, const WorkerReport& report) {
      const std::size_t i = model_of_job_[job];
      remember(job, report);
      progress_.finished(i, report, jobs_[job].output);
      if (seconds_since(saved) > 30) {  // a killed run then loses little
        memo_.save();
        saved = Clock::now();
      }
    };
    const bool stop = settings_.pool.stop_on_failure && failure_recalled_;
    std::vector<WorkerReport> reports(jobs_.size());
    for (WorkerReport& r : reports) r.result = ModelResult::kCancelled;
    if (!stop) reports = run_workers(jobs_, settings_.pool, on_event, on_finish);
    for (std::size_t job = 0; job < reports.size(); ++job) {
      reports_[model_of_job_[job]] = reports[job];
      wrote_ = wrote_ || reports[job].stages_ran > 0;
    }
    if (!memo_.save())
      progress_.cache_event("cache-not-written", "what this run found out cannot be kept in " +
                                                     settings_.cache.folder + ": the next one looks again");
    seconds_ = seconds_since(start_);
    progress_.summary(reports_, seconds_);
  }

  /// Failures that only another machine or another moment explains are not remembered.
  static bool is_lasting(const WorkerReport& r) {
    return r.result == ModelResult::kFailed &&
           (r.error_kind == "input" || r.error_kind == "format" || r.error_kind == "stage");
  }

  void remember(std::size_t job, const WorkerReport& report) {
    const std::size_t i = model_of_job_[job];
    if (report.files.empty() || (!report.ok() && !is_lasting(report))) return;
    const PlannedModel& m = plan_.models[i];
    MemoRecord record;
    record.request = request_of(m.profile);
    record.failed = !report.ok();
    record.files = report.files;
    record.peak_memory_bytes = report.peak_memory_bytes;
    record.seconds = report.seconds;
    record.keys = report.keys;
    const bool known = records_[i].peak_memory_bytes > 0;
    // A run that found everything in the cache, or that failed on the way, says little about what the model
    // costs, and a failure nothing about what the stages that it did not reach would run with.
    if (known && (!report.ok() || report.stages_hit > report.stages_ran)) {
      record.peak_memory_bytes = records_[i].peak_memory_bytes;
      record.seconds = records_[i].seconds;
    }
    if (!report.ok()) record.keys.insert(jobs_[job].earlier_keys.begin(), jobs_[job].earlier_keys.end());
    if (report.ok()) {
      const auto stamp = stamp_of(m.output);
      if (!stamp) return;
      record.package_stamp = *stamp;
      record.package_digest = report.package_digest;
      record.package_bytes = report.package_bytes;
    } else {
      record.error = {report.error_kind,     report.error_file,  report.error_place,
                      report.error_expected, report.error_found, report.error_message};
    }
    record.looked_at_ns = wall_clock_ns();
    memo_.set(m.output, record);
  }

  int forecast() {
    begin_progress();
    const auto on_event = [&](std::size_t job, const std::string& line) {
      progress_.event(model_of_job_[job], line);
    };
    const auto reports = run_workers(jobs_, settings_.pool, on_event, {});
    for (std::size_t job = 0; job < reports.size(); ++job) reports_[model_of_job_[job]] = reports[job];
    progress_.forecast_summary(jobs_.size(), plan_.models.size());
    return exit_code();
  }

  void write_text(const std::string& path, const std::string& text) const {
    if (path.empty()) return;
    if (is_special_file(path)) return write_output_file(path, bytes_of(text));
    remove_stale_temporaries(fs::path(path).parent_path().string(), fs::path(path).filename().string());
    if (!file_holds(path, bytes_of(text))) write_output_file(path, bytes_of(text));
  }

  /// Each report on its own: one that cannot be written keeps no other from being.
  void write_reports() {
    const auto write = [&](const std::string& path, auto&& text) {
      try {
        if (!path.empty()) write_text(path, text());
      } catch (const InputError& e) {
        std::cerr << "texmesh compile: " << e.what() << '\n';
        report_missing_ = true;
      }
    };
    write(settings_.summary, [&] { return write_summary(plan_.models, reports_, seconds_); });
    write(settings_.junit, [&] { return write_junit(plan_.models, reports_, seconds_); });
    write(settings_.trace, [&] { return write_trace(plan_.models, reports_); });
    if (settings_.statistics && settings_.mode != OutputMode::kJson) std::cout << write_statistics(reports_);
    if (!settings_.depfile.empty() && reports_[0].ok())
      write(settings_.depfile, [&] { return write_depfile(plan_.models[0].output, dependencies()); });
  }

  std::vector<std::string> dependencies() const {
    const fs::path folder = fs::path(plan_.models[0].input).parent_path();
    std::vector<std::string> all;
    for (const FileRequest& f : reports_[0].files)
      if (f.found) all.push_back(f.uri.empty() ? plan_.models[0].input : (folder / f.uri).string());
    all.insert(all.end(), settings_.more_inputs.begin(), settings_.more_inputs.end());
    return all;
  }

  bool was_cancelled() const {
    return std::any_of(reports_.begin(), reports_.end(),
                       [](const WorkerReport& r) { return r.result == ModelResult::kCancelled; });
  }

  int exit_code() const {
    int code = report_missing_ ? kExitModelFailed : kExitOk;
    for (const WorkerReport& r : reports_) {
      if (r.result == ModelResult::kInternal) return kExitInternal;
      if (!r.ok()) code = kExitModelFailed;
    }
    return code;
  }

  const BatchPlan& plan_;
  const RunSettings& settings_;
  Clock::time_point start_ = Clock::now();
  BuildMemo memo_;
  std::vector<WorkerReport> reports_;
  std::vector<MemoRecord> records_;  // of an earlier run, for the models that run again
  std::vector<WorkerJob> jobs_;
  std::vector<std::size_t> model_of_job_;
  std::map<const std::string*, Sha256> requests_;
  std::string request_seed_;
  Progress progress_;
  std::string cache_problem_;
  double seconds_ = 0;
  bool wrote_ = false, failure_recalled_ = false, report_missing_ = false;
};

void check_report(const std::string& path) {
  if (path.empty() || is_special_file(path)) return;
  const std::string folder = fs::path(path).parent_path().string();
  if (fs::is_directory(path) || ::access(folder.empty() ? "." : folder.c_str(), W_OK) != 0)
    throw InputError(path, "", "a file that can be written",
                     fs::is_directory(path) ? "a folder" : std::strerror(errno));
}

}  // namespace

void check_reports(const BatchPlan& plan, const RunSettings& settings) {
  for (const std::string* path : {&settings.summary, &settings.junit, &settings.trace, &settings.depfile})
    check_report(*path);
  if (!settings.depfile.empty()) write_depfile(plan.models.at(0).output, {plan.models[0].input});
}

int run_batch(const BatchPlan& plan, const RunSettings& settings, std::ostream& out) {
  RunSettings own = settings;
  std::string problem;
  if (const std::string& folder = own.cache.folder; !folder.empty() && !own.dry_run)
    if (const std::string reason = make_cache_folder(folder); !reason.empty()) {
      problem = folder + " cannot be made (" + reason + "): nothing is kept, and nothing is found";
      own.cache.folder.clear();
    }
  return Batch(plan, own, out, std::move(problem)).run();
}

}  // namespace texmesh
