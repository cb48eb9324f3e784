// A run of compile: which models must run, by the memo of earlier runs; then their processes, and what they
// report.

#include <filesystem>
#include <ostream>

#include "pipeline/batch/build_memo.h"
#include "pipeline/batch/fleet/run_summary.h"
#include "pipeline/batch/run.h"
#include "pipeline/batch/stale_packages.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/resolver.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
using Clock = std::chrono::steady_clock;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

class Batch {
 public:
  /// `cache_problem`: why there is no cache folder though one was asked for.
  Batch(const BatchPlan& plan, const RunSettings& settings, std::ostream& out, std::string cache_problem)
      : plan_(plan),
        settings_(settings),
        selection_(plan, settings),
        reports_(plan.models.size()),
        progress_(out, settings.mode, settings.verbose, settings.explain),
        cache_problem_(std::move(cache_problem)) {}

  int run() {
    selection_.select(reports_);
    if (settings_.dry_run) return forecast();
    make_folders();
    remove_leftovers();
    compile();
    if (plan_.shard.index == 0 && !was_cancelled())
      list_stale(plan_.outputs, settings_.remove_stale ? std::vector<std::string>() : plan_.stale);
    const bool all_written = write_reports(plan_, settings_, reports_, seconds_);
    if (wrote_ && !was_cancelled() && !settings_.cache.folder.empty())
      prune_now_and_then(settings_.cache.folder, settings_.cache_limits);
    return exit_code(all_written);
  }

 private:
  /// A new package that cannot be written is told before the work. One that is there may turn out to be up to
  /// date.
  void make_folders() const {
    std::set<std::string> made;
    for (const WorkerJob& job : selection_.jobs()) {
      const std::string folder = fs::path(job.output).parent_path().string();
      std::error_code ec;
      if (!folder.empty() && made.insert(folder).second) fs::create_directories(folder, ec);
      if (ec) fail_to_write(folder, "", ec.value());
      if (!fs::exists(job.output, ec)) check_output_file(job.output);
    }
  }

  /// What killed runs have left beside the packages.
  void remove_leftovers() const {
    std::set<std::string_view> folders;
    for (const PlannedModel& m : plan_.models) {
      const std::size_t slash = m.output.rfind('/');  // fs::path took a tenth of a run that does nothing
      folders.insert(
          std::string_view(m.output).substr(0, slash == std::string::npos ? 0 : slash + (slash == 0)));
    }
    for (const std::string_view folder : folders) remove_stale_temporaries(std::string(folder), ".texmesh");
  }

  /// Shards see the same folder; one of them speaks.
  std::vector<std::string> told_stale() const {
    return plan_.shard.index == 0 ? plan_.stale : std::vector<std::string>();
  }

  void begin_progress() {
    std::vector<ProgressModel> models;
    models.reserve(plan_.models.size());
    for (std::size_t i = 0; i < plan_.models.size(); ++i) models.push_back({plan_.models[i].name(), 0});
    for (std::size_t j = 0; j < selection_.jobs().size(); ++j)
      models[selection_.model_of(j)].weight = selection_.jobs()[j].predicted_s;
    progress_.begin(std::move(models));
    if (!cache_problem_.empty()) progress_.cache_event("cache-not-written", cache_problem_);
    if (selection_.memo_was_damaged())
      progress_.cache_event(
          "cache-entry-damaged",
          "what earlier runs found out does not have its digest; those models are looked at again");
    std::size_t next = 0;
    for (std::size_t i = 0; i < plan_.models.size(); ++i) {
      if (next < selection_.jobs().size() && selection_.model_of(next) == i)
        ++next;
      else
        progress_.recalled(i, reports_[i], plan_.models[i].output);
    }
  }

  void compile() {
    begin_progress();
    std::vector<bool> announced(selection_.jobs().size());
    auto saved = Clock::now();
    const auto on_event = [&](std::size_t job, WorkerEvent event) {
      const std::size_t i = selection_.model_of(job);
      if (!announced[job]) progress_.started(i, selection_.jobs()[job].output);
      announced[job] = true;
      progress_.event(i, std::move(event));
    };
    const auto on_finish = [&](std::size_t job, const WorkerReport& report) {
      const std::size_t i = selection_.model_of(job);
      selection_.remember(job, report);
      progress_.finished(i, report, selection_.jobs()[job].output);
      if (seconds_since(saved) > 30) {  // a killed run then loses little
        selection_.save_memo();
        saved = Clock::now();
      }
    };
    const bool stop = settings_.pool.stop_on_failure && selection_.recalled_failures() > 0;
    std::vector<WorkerReport> reports(selection_.jobs().size());
    for (WorkerReport& r : reports) r.result = ModelResult::kCancelled;
    if (!stop) reports = run_workers(selection_.jobs(), settings_.pool, on_event, on_finish);
    for (std::size_t job = 0; job < reports.size(); ++job) {
      selection_.tell_earlier_cost(job, reports[job]);
      reports_[selection_.model_of(job)] = reports[job];
      wrote_ = wrote_ || reports[job].stages_ran > 0;
    }
    if (!selection_.save_memo())
      progress_.cache_event("cache-not-written", "what this run found out cannot be kept in " +
                                                     settings_.cache.folder + ": the next one looks again");
    seconds_ = seconds_since(start_);
    if (settings_.remove_stale && !was_cancelled()) remove_stale(plan_.outputs, told_stale());
    progress_.summary(reports_, seconds_, told_stale(), settings_.remove_stale);
  }

  int forecast() {
    begin_progress();
    const auto on_event = [&](std::size_t job, WorkerEvent event) {
      progress_.event(selection_.model_of(job), std::move(event));
    };
    progress_.forecast_summary(selection_.jobs().size(), plan_.models.size(), selection_.recalled_failures(),
                               told_stale());
    const auto on_finish = [&](std::size_t job, const WorkerReport&) {
      progress_.foreseen(selection_.model_of(job));
    };
    const auto reports = run_workers(selection_.jobs(), settings_.pool, on_event, on_finish);
    for (std::size_t job = 0; job < reports.size(); ++job) reports_[selection_.model_of(job)] = reports[job];
    return exit_code(true);
  }

  bool was_cancelled() const {
    return std::any_of(reports_.begin(), reports_.end(),
                       [](const WorkerReport& r) { return r.result == ModelResult::kCancelled; });
  }

  int exit_code(bool all_written) const {
    int code = all_written ? kExitOk : kExitTryAgain;
    const bool stopped = settings_.pool.stop_on_failure &&
                         std::any_of(reports_.begin(), reports_.end(),
                                     [](const WorkerReport& r) { return r.result == ModelResult::kFailed; });
    for (const WorkerReport& r : reports_)
      if (!stopped || r.result != ModelResult::kCancelled)  // after --fail-fast: not asked to be tried again
        code = graver_exit_code(code, exit_code_of(r.result, r.more->error.kind));
    return code;
  }

  const BatchPlan& plan_;
  const RunSettings& settings_;
  Clock::time_point start_ = Clock::now();
  JobSelection selection_;
  std::vector<WorkerReport> reports_;
  Progress progress_;
  std::string cache_problem_;
  double seconds_ = 0;
  bool wrote_ = false;  // some stage ran
};

}  // namespace

int run_batch(const BatchPlan& plan, const RunSettings& settings, std::ostream& out) {
  RunSettings with_cache = settings;
  std::string problem;
  if (const std::string& folder = with_cache.cache.folder; !folder.empty() && !with_cache.dry_run)
    if (const std::string reason = make_cache_folder(folder); !reason.empty()) {
      problem = folder + " cannot be made (" + reason + "): nothing is kept, and nothing is found";
      with_cache.cache.folder.clear();
    }
  return Batch(plan, with_cache, out, std::move(problem)).run();
}

}  // namespace texmesh
