// The child process: one model, event lines on standard output.
#include <fcntl.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <iostream>
#include <mutex>
#include <new>
#include <nlohmann/json.hpp>

#include "pipeline/cli/commands.h"
#include "pipeline/worker.h"

namespace texmesh {
namespace {

using Json = nlohmann::ordered_json;

std::atomic<bool> g_cancelled{false};  // set by the signal handler only

/// Event lines go to the real standard output; whatever libraries print goes to standard error instead.
class EventWriter {
 public:
  EventWriter() : fd_(::fcntl(1, F_DUPFD_CLOEXEC, 3)) { ::dup2(2, 1); }
  void write(const Json& event) {
    const std::string line = event.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
    const std::lock_guard lock(mutex_);
    for (std::size_t at = 0; at < line.size();) {
      const ssize_t n = ::write(fd_, line.data() + at, line.size() - at);
      if (n <= 0) return;  // the parent is gone, and this process with it in a moment
      at += static_cast<std::size_t>(n);
    }
  }

 private:
  int fd_;
  std::mutex mutex_;
};

void limit(int resource, std::uint64_t value) {
  if (value == 0) return;
  const rlimit r{value, value};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &r);
}

void apply_limits(const Json& job) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers map terabytes of shadow
  limit(RLIMIT_AS, job.value("memory_bytes", std::uint64_t{0}));
#endif
  limit(RLIMIT_CPU, job.value("cpu_s", std::uint64_t{0}));
  struct sigaction action {};
  action.sa_handler = [](int) { g_cancelled = true; };
  ::sigaction(SIGTERM, &action, nullptr);
  ::signal(SIGINT, SIG_IGN);   // the parent decides
  ::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of write(), not a death
}

StageObserver stage_events(EventWriter& events) {
  return [&events, last = std::chrono::steady_clock::time_point{}](const Stage& stage, StageEvent event,
                                                                   double fraction, double seconds) mutable {
    const auto now = std::chrono::steady_clock::now();
    switch (event) {
      case StageEvent::kStarted:
        events.write({{"event", "stage-started"}, {"stage", stage.name}});
        break;
      case StageEvent::kProgress:
        if (now - last < std::chrono::milliseconds(100)) return;
        last = now;
        events.write({{"event", "stage-progress"}, {"stage", stage.name}, {"fraction", fraction}});
        break;
      case StageEvent::kHit:
        events.write(
            {{"event", "stage-finished"}, {"stage", stage.name}, {"result", "hit"}, {"seconds", 0.0}});
        break;
      case StageEvent::kRan:
        events.write(
            {{"event", "stage-finished"}, {"stage", stage.name}, {"result", "ran"}, {"seconds", seconds}});
        break;
    }
  };
}

int report_error(EventWriter& events, const char* kind, const Error& e) {
  events.write({{"event", "error"},
                {"kind", kind},
                {"file", e.file()},
                {"place", e.place()},
                {"expected", e.expected()},
                {"found", e.found()},
                {"message", e.what()}});
  return kExitModelFailed;
}

int compile(const Json& job, EventWriter& events) {
  CompileRequest request;
  request.input = job.at("input").get<std::string>();
  request.output = job.at("output").get<std::string>();
  request.temporary = job.at("temporary").get<std::string>();
  request.strict = job.at("strict").get<bool>();
  read_profile(request.options, job.at("profile").get<std::string>(), "options");
  RunContext context;
  context.threads = job.at("threads").get<int>();
  context.cancelled = &g_cancelled;
  const std::string cache = job.at("cache").get<std::string>();
  const std::unique_ptr<Store> store = cache.empty() ? std::make_unique<NullStore>() : open_disk_store(cache);

  const CompileOutcome outcome = compile_model(request, *store, context, stage_events(events));
  for (const Note& n : outcome.notes)
    events.write({{"event", "note"},
                  {"severity", n.severity == Severity::kWarning ? "warning" : "info"},
                  {"code", n.code},
                  {"place", n.place},
                  {"text", n.text}});
  events.write({{"event", "result"}, {"unchanged", outcome.unchanged}, {"bytes", outcome.package_bytes}});
  return kExitOk;
}

}  // namespace

int worker_main() {
  EventWriter events;
  const std::string input(std::istreambuf_iterator<char>(std::cin), {});
  const Json job = Json::parse(input, nullptr, false);
  if (!job.is_object()) return kExitUsage;
  apply_limits(job);
  try {
    return compile(job, events);
  } catch (const InputError& e) {
    return report_error(events, "input", e);
  } catch (const FormatError& e) {
    return report_error(events, "format", e);
  } catch (const StageError& e) {
    return report_error(events, "stage", e);
  } catch (const Cancelled&) {
    return kExitModelFailed;
  } catch (const std::bad_alloc&) {
    const std::string limit_text =
        std::to_string(job.value("memory_bytes", std::uint64_t{0}) >> 20) + " MiB of memory";
    return report_error(events, "resource",
                        InputError(std::filesystem::path(job.value("input", "")).filename().string(), "",
                                   "at most " + limit_text, "a need for more"));
  } catch (const std::exception& e) {
    return report_error(events, "internal", StageError("texmesh", "", "", e.what())), kExitInternal;
  }
}

}  // namespace texmesh
