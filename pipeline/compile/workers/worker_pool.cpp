// The parent's side of compiling in child processes.
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <map>
#include <numeric>
#include <optional>
#include <set>

#include "format/base/errors.h"
#include "pipeline/cache/cache_layer.h"
#include "pipeline/compile/workers/child_process.h"
#include "pipeline/compile/workers/worker.h"
#include "pipeline/compile/workers/worker_messages.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

using Clock = std::chrono::steady_clock;

/// From here on a model gets large pages. Simplification of four million triangles takes a tenth less time
/// with them, a whole compile of half a million up to 5 % less, and small models nothing but 2 to 6 % more
/// memory.
constexpr std::uint64_t kLargeModel_bytes = 1'000'000'000;

volatile sig_atomic_t g_interrupted = 0;

/// Catches SIGINT and SIGTERM while workers run and gives them back afterwards.
class InterruptGuard {
 public:
  InterruptGuard() {
    g_interrupted = 0;
    struct sigaction action {};
    action.sa_handler = [](int) { g_interrupted = 1; };
    ::sigaction(SIGINT, &action, &old_int_);
    ::sigaction(SIGTERM, &action, &old_term_);
    ::signal(SIGPIPE, SIG_IGN);
  }
  ~InterruptGuard() {
    ::sigaction(SIGINT, &old_int_, nullptr);
    ::sigaction(SIGTERM, &old_term_, nullptr);
  }

 private:
  struct sigaction old_int_ {
  }, old_term_{};
};

/// A child process and the job that it does.
struct Worker {
  std::size_t job = 0;
  int lane = 0;
  ChildProcess process;
  std::string line;        // what it has written of its next event line
  std::string last_words;  // the end of its standard error
  std::string temporary;   // file that it writes
  bool timed_out = false;
};

void read_events(Worker& worker, WorkerReport& report, double now_s, const EventSink& sink) {
  if (worker.process.out >= 0 && !read_available(worker.process.out, worker.line))
    close_fd(worker.process.out);
  for (std::size_t end; (end = worker.line.find('\n')) != std::string::npos;) {
    const std::string line = worker.line.substr(0, end);
    worker.line.erase(0, end + 1);
    const bool is_public = apply_event(line, now_s, report);
    if (sink && is_public && line.find("\"event\":\"result\"") == std::string::npos) sink(worker.job, line);
  }
}

/// Ends the spans of stages that will not end any more. Returns them as the place of an error: "running ssf,
/// zim".
std::string end_running_stages(WorkerReport& report) {
  std::string names;
  for (StageSpan& s : report.more->spans)
    if (s.running) {
      s.end_s = report.start_s + report.seconds;
      names += (names.empty() ? "running " : ", ") + s.stage;
    }
  return names;
}

void set_error(WorkerReport& report, const std::string& kind, const WorkerJob& job, std::string expected,
               std::string found) {
  const InputError e(std::filesystem::path(job.input).filename().string(), end_running_stages(report),
                     std::move(expected), std::move(found));
  report.more->error = {kind, e.file(), e.place(), e.expected(), e.found(), e.what()};
}

/// Enters into the report what the end of a worker means for its model.
void finish_report(const Worker& worker, int status, const rusage& usage, const WorkerLimits& limits,
                   const WorkerJob& job, bool interrupted, WorkerReport& report) {
  report.seconds = std::chrono::duration<double>(Clock::now() - worker.process.start).count();
  report.peak_memory_bytes = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
  const bool finished = WIFEXITED(status) && WEXITSTATUS(status) == kExitOk;
  if (finished && (report.result == ModelResult::kOk || report.result == ModelResult::kUnchanged)) return;
  if (!worker.temporary.empty()) ::unlink(worker.temporary.c_str());
  if (interrupted) {
    report.result = ModelResult::kCancelled;
    return;
  }
  report.result = ModelResult::kFailed;
  if (!report.more->error.kind.empty()) {
    if (report.more->error.kind == "internal") report.result = ModelResult::kInternal;
    return;
  }
  if (worker.timed_out) {
    set_error(report, "resource", job, "at most " + std::to_string(limits.wall_s) + " s",
              "a model that takes longer");
  } else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) {
    set_error(report, "resource", job, "at most " + std::to_string(limits.cpu_s) + " s of processor time",
              "a model that takes more");
  } else if (WIFSIGNALED(status) &&
             WTERMSIG(status) == SIGKILL) {  // what the kernel does when memory runs out
    set_error(report, "resource", job, "a worker that finishes",
              "that somebody killed it: out of memory, or an allocation that ended");
  } else {
    report.result = ModelResult::kInternal;
    const std::string how = WIFSIGNALED(status) ? std::string("signal ") + strsignal(WTERMSIG(status))
                                                : "exit code " + std::to_string(WEXITSTATUS(status));
    set_error(report, "internal", job, "a worker that finishes",
              how + (worker.last_words.empty() ? "" : ": " + worker.last_words));
  }
}

/// The order in which jobs start: longest first, so that no long one is left for the end; unknown ones by
/// their size.
std::vector<std::size_t> start_order(const std::vector<WorkerJob>& jobs) {
  std::vector<std::size_t> order(jobs.size());
  std::iota(order.begin(), order.end(), 0);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return jobs[a].predicted_s > jobs[b].predicted_s; });
  return order;
}

/// All workers of one run.
class WorkerPool {
 public:
  WorkerPool(const std::vector<WorkerJob>& jobs, const PoolSettings& settings, const EventSink& sink,
             const FinishSink& finished)
      : jobs_(jobs),
        settings_(settings),
        limits_(settings.limits),
        sink_(sink),
        finished_(finished),
        reports_(jobs.size()),
        waiting_(start_order(jobs)) {
    for (WorkerReport& r : reports_) r.result = ModelResult::kCancelled;
  }

  std::vector<WorkerReport> run() {
    bool stop = false;
    while (!workers_.empty() || (!waiting_.empty() && !stop && !g_interrupted)) {
      while (!stop && !g_interrupted && start_one()) continue;
      if (g_interrupted) interrupt_workers();
      wait_for_something();
      enforce_wall_limit();
      if (remove_ended() && settings_.stop_on_failure) stop = true;
    }
    return std::move(reports_);
  }

 private:
  double now_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  /// Starts the first waiting job that fits; false when none does.
  bool start_one() {
    const int processors = std::max(settings_.processors, 1);
    if (waiting_.empty() || workers_.size() >= static_cast<std::size_t>(processors)) return false;
    std::uint64_t in_use = 0;
    for (const Worker& w : workers_) in_use += jobs_[w.job].predicted_memory_bytes;
    const auto fits = [&](std::size_t job) {
      return workers_.empty() || settings_.memory_bytes == 0 ||
             in_use + jobs_[job].predicted_memory_bytes <= settings_.memory_bytes;
    };
    const auto next = std::find_if(waiting_.begin(), waiting_.end(), fits);
    if (next == waiting_.end()) return false;
    const std::size_t job = *next;
    waiting_.erase(next);
    reports_[job].result = ModelResult::kInternal;
    reports_[job].ran = true;
    const std::size_t side_by_side =
        std::min<std::size_t>(static_cast<std::size_t>(processors), workers_.size() + 1 + waiting_.size());
    const int threads = std::max(1, processors / static_cast<int>(side_by_side));
    workers_.push_back(start_worker(job, threads));
    return true;
  }

  Worker start_worker(std::size_t index, int threads) {
    const WorkerJob& job = jobs_[index];
    Worker worker;
    worker.job = index;
    worker.lane = free_lane();
    worker.temporary = job.output.empty() || job.forecast ? "" : temporary_name(job.output, index);
    std::set<std::string> resting;
    for (const auto& [layer, rest] : layers_left_out_)
      if (rest.holds()) resting.insert(layer);
    worker.process = start_worker_process(job_to_json(job, worker.temporary, limits_, threads, resting),
                                          job.predicted_memory_bytes >= kLargeModel_bytes);
    reports_[index].lane = worker.lane;
    reports_[index].start_s = now_s();
    return worker;
  }

  int free_lane() const {
    for (int lane = 0;; ++lane)
      if (std::none_of(workers_.begin(), workers_.end(), [&](const Worker& w) { return w.lane == lane; }))
        return lane;
  }

  void wait_for_something() {
    std::vector<pollfd> fds;
    for (const Worker& w : workers_)
      for (int fd : {w.process.out, w.process.err})
        if (fd >= 0) fds.push_back({fd, POLLIN, 0});
    ::poll(fds.data(), fds.size(), fds.empty() ? 5 : 100);
    for (Worker& w : workers_) {
      read_events(w, reports_[w.job], now_s(), sink_);
      leave_layers_out(w.job);
      if (w.process.err >= 0 && !read_available(w.process.err, w.last_words)) close_fd(w.process.err);
      if (w.last_words.size() > 2000) w.last_words.erase(0, w.last_words.size() - 2000);
    }
  }

  void leave_layers_out(std::size_t job) {
    const std::vector<std::string>& layers = jobs_[job].cache.layers;
    for (const int number : reports_[job].more->layers_left_out)
      if (number >= 0 && static_cast<std::size_t>(number) < layers.size())
        layers_left_out_[layers[static_cast<std::size_t>(number)]].begin();
    reports_[job].more->layers_left_out.clear();  // the rest begins once
  }

  void enforce_wall_limit() {
    if (limits_.wall_s == 0) return;
    for (Worker& w : workers_)
      if (!w.timed_out && Clock::now() - w.process.start > std::chrono::seconds(limits_.wall_s)) {
        w.timed_out = true;
        ::kill(w.process.pid, SIGKILL);
      }
  }

  /// SIGTERM first, so that a worker can finish a write; SIGKILL after a second.
  void interrupt_workers() {
    if (!interrupted_at_) {
      interrupted_at_ = Clock::now();
      for (const Worker& w : workers_) ::kill(w.process.pid, SIGTERM);
    } else if (Clock::now() - *interrupted_at_ > std::chrono::seconds(1)) {
      for (const Worker& w : workers_) ::kill(w.process.pid, SIGKILL);
    }
  }

  /// Removes the workers that have ended; true when one of them failed.
  bool remove_ended() {
    bool failed = false;
    for (std::size_t i = 0; i < workers_.size();) {
      Worker& w = workers_[i];
      int status = 0;
      rusage usage{};
      if (::wait4(w.process.pid, &status, WNOHANG, &usage) != w.process.pid) {
        ++i;
        continue;
      }
      WorkerReport& report = reports_[w.job];
      read_events(w, report, now_s(), sink_);
      leave_layers_out(w.job);
      if (w.process.err >= 0) read_available(w.process.err, w.last_words);
      const bool told = !report.more->error.kind.empty();
      finish_report(w, status, usage, limits_, jobs_[w.job], g_interrupted != 0, report);
      if (!told && !report.more->error.kind.empty() && sink_) sink_(w.job, error_event(report));
      failed = failed || !report.ok();
      close_fd(w.process.out);
      close_fd(w.process.err);
      if (finished_) finished_(w.job, report);
      workers_.erase(workers_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    return failed;
  }

  const std::vector<WorkerJob>& jobs_;
  const PoolSettings& settings_;
  const WorkerLimits& limits_;
  const EventSink& sink_;
  const FinishSink& finished_;
  std::vector<WorkerReport> reports_;
  std::vector<std::size_t> waiting_;
  std::vector<Worker> workers_;
  std::map<std::string, LayerRest> layers_left_out_;
  Clock::time_point start_ = Clock::now();
  std::optional<Clock::time_point> interrupted_at_;
};

}  // namespace

std::vector<WorkerReport> run_workers(const std::vector<WorkerJob>& jobs, const PoolSettings& settings,
                                      const EventSink& sink, const FinishSink& finished) {
  if (jobs.empty()) return {};
  const InterruptGuard guard;
  return WorkerPool(jobs, settings, sink, finished).run();
}

}  // namespace texmesh
