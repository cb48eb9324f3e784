// The parent's side of compiling in child processes.
#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/cache/cache_layer.h"
#include "pipeline/compile/workers/worker.h"
#include "pipeline/import/import.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/exit_codes.h"

namespace texmesh {
namespace {

using Clock = std::chrono::steady_clock;

/// Appends what can be read now; false at the end of the file.
bool read_available(int fd, std::string& into) {
  char buffer[65536];
  for (;;) {
    const ssize_t n = ::read(fd, buffer, sizeof buffer);
    if (n > 0)
      into.append(buffer, static_cast<std::size_t>(n));
    else if (n == 0)
      return false;
    else if (errno != EINTR)
      return errno == EAGAIN;
  }
}

/// Closes a descriptor that is open and sets it to -1.
void close_fd(int& fd) {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

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
    std::optional<WorkerEvent> event = read_event(line);
    if (event && apply_event(*event, now_s, report) && sink) sink(worker.job, std::move(*event));
  }
}

/// Of a model with a thousand warnings the first say enough.
void keep_note(const Note& note, Notes& told) {
  if (told.size() < kMostToldNotes)
    told.push_back(note);
  else if (told.size() == kMostToldNotes)
    told.push_back({Severity::kWarning, "more", "", "there are more than these"});
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
        origin_(jobs.size()),
        reports_(jobs.size()),
        waiting_(start_order(jobs)) {
    for (WorkerReport& r : reports_) r.result = ModelResult::kCancelled;
  }

  std::vector<WorkerReport> run() {
    while (!workers_.empty() || (!waiting_.empty() && !stop_ && !g_interrupted)) {
      while (!stop_ && !g_interrupted && start_one()) continue;
      if (g_interrupted) interrupt_workers();
      wait_for_something();
      enforce_wall_limit();
      remove_ended();
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
    const std::size_t side_by_side =
        std::min<std::size_t>(static_cast<std::size_t>(processors), workers_.size() + waiting_.size());
    const int threads = std::max(1, processors / static_cast<int>(side_by_side));
    try {
      workers_.push_back(start_worker(job, threads));
      reports_[job].result = ModelResult::kInternal;
    } catch (const ResourceError& e) {
      if (!workers_.empty()) return false;  // what they give back when they end may be enough
      reports_[job].result = ModelResult::kFailed;
      set_error(reports_[job], "resource", jobs_[job], e.expected(), e.found());
      tell_end(job, true);
    }
    reports_[job].ran = true;
    waiting_.erase(next);
    return true;
  }

  Worker start_worker(std::size_t index, int threads) {
    const WorkerJob& job = jobs_[index];
    Worker worker;
    worker.job = index;
    worker.lane = free_lane();
    worker.temporary = job.output.empty() || job.forecast ? "" : temporary_name(job.output, index);
    worker.process = origin_.start(to_json_line(task_of(job, worker.temporary, threads)));
    reports_[index].lane = worker.lane;
    reports_[index].start_s = now_s();
    return worker;
  }

  WorkerTask task_of(const WorkerJob& job, const std::string& temporary, int threads) const {
    WorkerTask task{job, limits_, temporary, threads, ::getpid()};
    for (std::string& layer : task.job.cache.layers)
      if (const auto rest = layers_left_out_.find(layer);
          rest != layers_left_out_.end() && rest->second.holds())
        layer.clear();
    return task;
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

  void remove_ended() {
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
      close_fd(w.process.out);
      close_fd(w.process.err);
      tell_end(w.job, !told && !report.more->error.kind.empty());
      workers_.erase(workers_.begin() + static_cast<std::ptrdiff_t>(i));
    }
  }

  void tell_end(std::size_t job, bool tell_error) {
    const WorkerReport& report = reports_[job];
    if (tell_error && sink_) sink_(job, ErrorTold{"", report.more->error});
    if (finished_) finished_(job, report);
    if (!report.ok() && settings_.stop_on_failure) stop_ = true;
  }

  const std::vector<WorkerJob>& jobs_;
  const PoolSettings& settings_;
  const WorkerLimits& limits_;
  const EventSink& sink_;
  const FinishSink& finished_;
  WorkerOrigin origin_;
  std::vector<WorkerReport> reports_;
  std::vector<std::size_t> waiting_;
  std::vector<Worker> workers_;
  bool stop_ = false;  // no further job starts
  std::map<std::string, LayerRest> layers_left_out_;
  Clock::time_point start_ = Clock::now();
  std::optional<Clock::time_point> interrupted_at_;
};

/// Enters a stage's begin or end into the report's spans.
void apply_stage(const StageStarted& e, double now_s, WorkerReport& report) {
  report.more->spans.push_back({e.stage, now_s, now_s, false, true});
}
void apply_stage(const StageFinished& e, double now_s, WorkerReport& report) {
  const bool hit = e.result == "hit";
  ++(hit ? report.stages_hit : report.stages_ran);
  auto& spans = report.more->spans;
  const auto open =
      std::find_if(spans.rbegin(), spans.rend(), [&](const StageSpan& s) { return s.stage == e.stage; });
  if (hit || open == spans.rend()) {
    spans.push_back({e.stage, now_s, now_s, hit});
  } else {
    open->end_s = now_s;
    open->running = false;
  }
}

/// The event of the list whose name the line has.
template <class... E>
std::optional<std::variant<E...>> event_of(const Json& json, const std::variant<E...>*) {
  std::optional<std::variant<E...>> event;
  const auto name = json.find("event");
  if (name == json.end()) return event;
  const auto read = [&](const auto* type) {
    using Event = std::remove_cvref_t<decltype(*type)>;
    if (*name == Event::kEvent) event = from_json<Event>(json, "event");
  };
  (read(static_cast<const E*>(nullptr)), ...);
  return event;
}

}  // namespace

bool is_told_always(const Note& note) {
  static constexpr const char* kRoundedNote = "rounded-position";  // of condition: the surface has changed
  return note.severity == Severity::kWarning || note.code == kLostNote || note.code == kRoundedNote;
}

bool apply_event(const WorkerEvent& event, double now_s, WorkerReport& report) {
  if (const auto* left_out = std::get_if<LayerLeftOut>(&event)) {
    report.more->layers_left_out.push_back(left_out->layer);
    return false;
  }
  if (const auto* inputs = std::get_if<InputsTold>(&event)) {
    report.more->files = inputs->files;
    report.more->keys = inputs->keys;
    report.package_digest = inputs->package.value_or(Sha256{});
    return false;
  }
  if (const auto* made = std::get_if<PackageMade>(&event)) {
    report.bytes = made->bytes;
    report.result = made->unchanged ? ModelResult::kUnchanged : ModelResult::kOk;
    return false;
  }
  if (const auto* started = std::get_if<StageStarted>(&event)) apply_stage(*started, now_s, report);
  if (const auto* finished = std::get_if<StageFinished>(&event)) apply_stage(*finished, now_s, report);
  if (const auto* error = std::get_if<ErrorTold>(&event)) report.more->error = error->error;
  if (const auto* told = std::get_if<NoteTold>(&event); told && is_told_always(told->note))
    keep_note(told->note, report.more->told);
  return true;
}

std::vector<WorkerReport> run_workers(const std::vector<WorkerJob>& jobs, const PoolSettings& settings,
                                      const EventSink& sink, const FinishSink& finished) {
  if (jobs.empty()) return {};
  const InterruptGuard guard;
  return WorkerPool(jobs, settings, sink, finished).run();
}

std::optional<WorkerEvent> read_event(const std::string& line) {
  const Json json = Json::parse(line, nullptr, false);
  if (!json.is_object()) return std::nullopt;
  try {
    return event_of(json, static_cast<const WorkerEvent*>(nullptr));
  } catch (const InputError&) {
    return std::nullopt;
  }
}

DocumentSchema event_schema() {
  const auto one_of = []<class... Event>(std::tuple<Event...>*) {
    return Json{{"oneOf", Json::array({schema_of<Event>()...})}};
  };
  using Shown = std::tuple<ModelStarted, StageStarted, StageProgress, StageFinished, StageExplained,
                           CacheTold, NoteTold, ErrorTold, PackageMade, ModelFinished, RunFinished>;
  return document_schema(
      "event.v1", "texmesh log event, version 1",
      "One line of `texmesh compile --json`. Programs ignore events that they do not know.",
      one_of(static_cast<Shown*>(nullptr)));
}

}  // namespace texmesh
