// The parent's side of compiling in child processes.
#include "pipeline/compile/worker.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>
#include <set>

#include "format/base/errors.h"
#include "pipeline/io/atomic_file.h"
#include "pipeline/io/core_path.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/wire_text.h"

extern char** environ;

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

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

struct Child {
  std::size_t job = 0;
  int lane = 0;
  pid_t pid = -1;
  int out = -1, err = -1;
  std::string line, last_words, temporary;
  Clock::time_point start;
  bool timed_out = false;
};

void close_fd(int& fd) {
  if (fd >= 0) ::close(fd);
  fd = -1;
}

struct Pipe {
  int read = -1, write = -1;
  Pipe() {
    int fds[2];
    if (::pipe2(fds, O_CLOEXEC) != 0) throw std::runtime_error(std::string("pipe: ") + std::strerror(errno));
    read = fds[0];
    write = fds[1];
  }
};

void write_all(int fd, const std::string& text) {
  std::size_t at = 0;
  while (at < text.size()) {
    const ssize_t n = ::write(fd, text.data() + at, text.size() - at);
    if (n < 0 && errno == EINTR) continue;
    if (n < 0) return;  // the child is gone; its exit status says the rest
    at += static_cast<std::size_t>(n);
  }
}

/// The layers of a job; null stands for one that is left out, so that their numbers stay.
Json layers_of(const CacheSettings& cache, const std::set<std::string>& left_out) {
  Json layers = Json::array();
  for (const std::string& place : cache.layers)
    layers.push_back(left_out.contains(place) ? Json() : Json(to_wire(place)));
  return layers;
}

std::string job_text(const WorkerJob& job, const std::string& temporary, const WorkerLimits& limits,
                     int threads, const std::set<std::string>& layers_left_out) {
  Json keys = Json::object();
  for (const auto& [stage, key] : job.earlier_keys) keys[stage] = to_hex(key);
  return Json{{"input", to_wire(job.input)},
              {"output", to_wire(job.output)},
              {"temporary", to_wire(temporary)},
              {"profile", *job.profile},
              {"cache", to_wire(job.cache.folder)},
              {"layers", layers_of(job.cache, layers_left_out)},
              {"upload", job.cache.upload},
              {"strict", job.strict},
              {"parent", ::getpid()},
              {"explain", job.explain},
              {"forecast", job.forecast},
              {"known", files_to_json(job.known)},
              {"keys", keys},
              {"threads", threads},
              {"wall_s", limits.wall_s},
              {"memory_bytes", limits.memory_bytes},
              {"cpu_s", limits.cpu_s}}
      .dump();
}

Child start_child(const WorkerJob& job, std::size_t index, const WorkerLimits& limits, int threads,
                  const std::set<std::string>& layers_left_out) {
  static const std::string executable = core_executable();
  Child child;
  child.job = index;
  child.temporary = job.output.empty() || job.forecast ? "" : temporary_name(job.output, index);
  Pipe in, out, err;
  posix_spawn_file_actions_t actions;
  posix_spawn_file_actions_init(&actions);
  posix_spawn_file_actions_adddup2(&actions, in.read, 0);
  posix_spawn_file_actions_adddup2(&actions, out.write, 1);
  posix_spawn_file_actions_adddup2(&actions, err.write, 2);
  std::string name = "texmesh", command = "worker";
  char* argv[] = {name.data(), command.data(), nullptr};
  const int rc = ::posix_spawn(&child.pid, executable.c_str(), &actions, nullptr, argv, environ);
  posix_spawn_file_actions_destroy(&actions);
  ::close(in.read);
  ::close(out.write);
  ::close(err.write);
  if (rc != 0) throw std::runtime_error(std::string("cannot start a worker: ") + std::strerror(rc));
  write_all(in.write, job_text(job, child.temporary, limits, threads, layers_left_out));
  ::close(in.write);
  child.out = out.read;
  child.err = err.read;
  for (int fd : {child.out, child.err}) ::fcntl(fd, F_SETFL, O_NONBLOCK);
  child.start = Clock::now();
  return child;
}

void take_stage(const Json& e, double now_s, WorkerReport& report) {
  const std::string stage = e.value("stage", "");
  if (e.value("event", "") == "stage-started") {
    report.spans.push_back({stage, now_s, now_s, false, true});
    return;
  }
  const bool hit = e.value("result", "") == "hit";
  ++(hit ? report.stages_hit : report.stages_ran);
  const auto open = std::find_if(report.spans.rbegin(), report.spans.rend(),
                                 [&](const StageSpan& s) { return s.stage == stage; });
  if (hit || open == report.spans.rend()) {
    report.spans.push_back({stage, now_s, now_s, hit});
  } else {
    open->end_s = now_s;
    open->running = false;
  }
}

void take_inputs(const Json& e, WorkerReport& report) {
  report.files = files_from_json(e.value("files", ""));
  from_hex(e.value("package", ""), report.package_digest);
  const Json keys = e.value("keys", Json::object());
  for (const auto& [stage, key] : keys.items())
    if (Sha256 digest; key.is_string() && from_hex(key.get<std::string>(), digest))
      report.keys[stage] = digest;
}

/// Takes what an event says about the model into its report. False: it is for this process alone.
bool take_event(const std::string& line, double now_s, WorkerReport& report) {
  const Json e = Json::parse(line, nullptr, false);
  if (!e.is_object()) return true;
  const std::string event = e.value("event", "");
  if (event == "inputs") {
    take_inputs(e, report);
    return false;
  }
  if (event == "layer-left-out") {
    report.layers_left_out.push_back(e.value("layer", -1));
    return false;
  }
  if (event == "stage-started" || event == "stage-finished") {
    take_stage(e, now_s, report);
  } else if (event == "result") {
    report.package_bytes = e.value("bytes", std::uint64_t{0});
    report.result = e.value("unchanged", false) ? ModelResult::kUnchanged : ModelResult::kOk;
  } else if (event == "error") {
    report.error_kind = e.value("kind", "");
    report.error_file = e.value("file", "");
    report.error_place = e.value("place", "");
    report.error_expected = e.value("expected", "");
    report.error_found = e.value("found", "");
    report.error_message = e.value("message", "");
  }
  return true;
}

/// Reads what is there; false at end of file.
bool drain(int fd, std::string& into) {
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

void read_events(Child& child, WorkerReport& report, double now_s, const EventSink& sink) {
  if (child.out >= 0 && !drain(child.out, child.line)) close_fd(child.out);
  for (std::size_t end; (end = child.line.find('\n')) != std::string::npos;) {
    const std::string line = child.line.substr(0, end);
    child.line.erase(0, end + 1);
    const bool is_public = take_event(line, now_s, report);
    if (sink && is_public && line.find("\"event\":\"result\"") == std::string::npos) sink(child.job, line);
  }
}

/// Ends the spans of stages that will not end any more; returns them as the place of an error: `running ssf,
/// zim`.
std::string end_running_stages(WorkerReport& report) {
  std::string names;
  for (StageSpan& s : report.spans)
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
  report.error_kind = kind;
  report.error_file = e.file();
  report.error_place = e.place();
  report.error_expected = e.expected();
  report.error_found = e.found();
  report.error_message = e.what();
}

/// What the end of a child means for its model.
void conclude(const Child& child, int status, const rusage& usage, const WorkerLimits& limits,
              const WorkerJob& job, bool interrupted, WorkerReport& report) {
  report.seconds = std::chrono::duration<double>(Clock::now() - child.start).count();
  report.peak_memory_bytes = static_cast<std::uint64_t>(usage.ru_maxrss) * 1024;
  const bool finished = WIFEXITED(status) && WEXITSTATUS(status) == kExitOk;
  if (finished && (report.result == ModelResult::kOk || report.result == ModelResult::kUnchanged)) return;
  if (!child.temporary.empty()) ::unlink(child.temporary.c_str());
  if (interrupted) {
    report.result = ModelResult::kCancelled;
    return;
  }
  report.result = ModelResult::kFailed;
  if (!report.error_kind.empty()) {
    if (report.error_kind == "internal") report.result = ModelResult::kInternal;
    return;
  }
  if (child.timed_out) {
    set_error(report, "resource", job, "at most " + std::to_string(limits.wall_s) + " s",
              "a model that takes longer");
  } else if (WIFSIGNALED(status) && WTERMSIG(status) == SIGXCPU) {
    set_error(report, "resource", job, "at most " + std::to_string(limits.cpu_s) + " s of processor time",
              "a model that takes more");
  } else {
    report.result = ModelResult::kInternal;
    const std::string how = WIFSIGNALED(status) ? std::string("signal ") + strsignal(WTERMSIG(status))
                                                : "exit code " + std::to_string(WEXITSTATUS(status));
    set_error(report, "internal", job, "a worker that finishes",
              how + (child.last_words.empty() ? "" : ": " + child.last_words));
  }
}

std::string error_line(const WorkerReport& r) {
  return Json{{"event", "error"},          {"kind", r.error_kind},         {"file", r.error_file},
              {"place", r.error_place},    {"expected", r.error_expected}, {"found", r.error_found},
              {"message", r.error_message}}
      .dump(-1, ' ', false, Json::error_handler_t::replace);
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

/// All children of one run.
class Pool {
 public:
  Pool(const std::vector<WorkerJob>& jobs, const PoolSettings& settings, const EventSink& sink,
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
    while (!children_.empty() || (!waiting_.empty() && !stop && !g_interrupted)) {
      while (!stop && !g_interrupted && start_one()) continue;
      if (g_interrupted) interrupt_children();
      wait_for_something();
      enforce_wall_limit();
      if (reap() && settings_.stop_on_failure) stop = true;
    }
    return std::move(reports_);
  }

 private:
  double now_s() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }

  /// Starts the first waiting job that fits; false when none does.
  bool start_one() {
    const int processors = std::max(settings_.processors, 1);
    if (waiting_.empty() || children_.size() >= static_cast<std::size_t>(processors)) return false;
    std::uint64_t in_use = 0;
    for (const Child& c : children_) in_use += jobs_[c.job].predicted_memory_bytes;
    const auto fits = [&](std::size_t job) {
      return children_.empty() || settings_.memory_bytes == 0 ||
             in_use + jobs_[job].predicted_memory_bytes <= settings_.memory_bytes;
    };
    const auto next = std::find_if(waiting_.begin(), waiting_.end(), fits);
    if (next == waiting_.end()) return false;
    const std::size_t job = *next;
    waiting_.erase(next);
    reports_[job].result = ModelResult::kInternal;
    reports_[job].ran = true;
    const std::size_t side_by_side =
        std::min<std::size_t>(static_cast<std::size_t>(processors), children_.size() + 1 + waiting_.size());
    Child child = start_child(jobs_[job], job, limits_,
                              std::max(1, processors / static_cast<int>(side_by_side)), layers_left_out_);
    child.lane = free_lane();
    reports_[job].lane = child.lane;
    reports_[job].start_s = now_s();
    children_.push_back(std::move(child));
    return true;
  }

  int free_lane() const {
    for (int lane = 0;; ++lane)
      if (std::none_of(children_.begin(), children_.end(), [&](const Child& c) { return c.lane == lane; }))
        return lane;
  }

  void wait_for_something() {
    std::vector<pollfd> fds;
    for (const Child& c : children_)
      for (int fd : {c.out, c.err})
        if (fd >= 0) fds.push_back({fd, POLLIN, 0});
    ::poll(fds.data(), fds.size(), fds.empty() ? 5 : 100);
    for (Child& c : children_) {
      read_events(c, reports_[c.job], now_s(), sink_);
      leave_layers_out(c.job);
      if (c.err >= 0 && !drain(c.err, c.last_words)) close_fd(c.err);
      if (c.last_words.size() > 2000) c.last_words.erase(0, c.last_words.size() - 2000);
    }
  }

  void leave_layers_out(std::size_t job) {
    const std::vector<std::string>& layers = jobs_[job].cache.layers;
    for (const int number : reports_[job].layers_left_out)
      if (number >= 0 && static_cast<std::size_t>(number) < layers.size())
        layers_left_out_.insert(layers[static_cast<std::size_t>(number)]);
  }

  void enforce_wall_limit() {
    if (limits_.wall_s == 0) return;
    for (Child& c : children_)
      if (!c.timed_out && Clock::now() - c.start > std::chrono::seconds(limits_.wall_s)) {
        c.timed_out = true;
        ::kill(c.pid, SIGKILL);
      }
  }

  /// SIGTERM first, so that a child can finish a write; SIGKILL after a second.
  void interrupt_children() {
    if (!interrupted_at_) {
      interrupted_at_ = Clock::now();
      for (const Child& c : children_) ::kill(c.pid, SIGTERM);
    } else if (Clock::now() - *interrupted_at_ > std::chrono::seconds(1)) {
      for (const Child& c : children_) ::kill(c.pid, SIGKILL);
    }
  }

  /// Takes ended children off the list; true when one of them failed.
  bool reap() {
    bool failed = false;
    for (std::size_t i = 0; i < children_.size();) {
      Child& c = children_[i];
      int status = 0;
      rusage usage{};
      if (::wait4(c.pid, &status, WNOHANG, &usage) != c.pid) {
        ++i;
        continue;
      }
      WorkerReport& report = reports_[c.job];
      read_events(c, report, now_s(), sink_);
      leave_layers_out(c.job);
      if (c.err >= 0) drain(c.err, c.last_words);
      const bool told = !report.error_kind.empty();
      conclude(c, status, usage, limits_, jobs_[c.job], g_interrupted != 0, report);
      if (!told && !report.error_kind.empty() && sink_) sink_(c.job, error_line(report));
      failed = failed || !report.ok();
      close_fd(c.out);
      close_fd(c.err);
      if (finished_) finished_(c.job, report);
      children_.erase(children_.begin() + static_cast<std::ptrdiff_t>(i));
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
  std::vector<Child> children_;
  std::set<std::string> layers_left_out_;
  Clock::time_point start_ = Clock::now();
  std::optional<Clock::time_point> interrupted_at_;
};

}  // namespace

std::vector<WorkerReport> run_workers(const std::vector<WorkerJob>& jobs, const PoolSettings& settings,
                                      const EventSink& sink, const FinishSink& finished) {
  if (jobs.empty()) return {};
  const InterruptGuard guard;
  return Pool(jobs, settings, sink, finished).run();
}

}  // namespace texmesh
