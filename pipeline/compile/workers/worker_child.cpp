// The child process: one model, event lines on standard output.
#include <fcntl.h>
#include <fmt/format.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include <filesystem>
#include <iostream>
#include <mutex>
#include <new>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "pipeline/cache/cache_layer.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/compile/workers/worker.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/machine.h"

namespace texmesh {
namespace {

std::atomic<bool> g_cancelled{false};  // set by the signal handler only

/// Event lines go to the real standard output; whatever libraries print goes to standard error instead.
class EventWriter {
 public:
  EventWriter() : fd_(::fcntl(1, F_DUPFD_CLOEXEC, 3)) { ::dup2(2, 1); }
  template <class Event>
  void write(const Event& event) {
    const std::string line = to_json_line(event) + "\n";
    const std::lock_guard lock(mutex_);
    write_all(fd_, text_bytes(line));  // false: the parent is gone, and this process with it in a moment
  }

 private:
  int fd_;
  std::mutex mutex_;
};

/// `more`: from the soft limit, which a signal tells of, to the hard one, which kills.
void limit(int resource, std::uint64_t value, std::uint64_t more = 0) {
  if (value == 0) return;
  const rlimit r{value, value + more};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &r);
}

void apply_limits(const WorkerTask& task) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != task.parent) ::_exit(kExitInternal);  // it died before the line above
  owner_mark();  // looks at the machine while this process may still look
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers map terabytes of shadow
  limit(RLIMIT_AS, task.limits.memory_bytes);
#endif
  limit(RLIMIT_CPU, task.limits.cpu_s, 1);
  struct sigaction action {};
  action.sa_handler = [](int) { g_cancelled = true; };
  ::sigaction(SIGTERM, &action, nullptr);
  ::signal(SIGINT, SIG_IGN);   // the parent decides
  ::signal(SIGXFSZ, SIG_IGN);  // a file size limit is an error of write(), not a death
}

[[maybe_unused]] std::string real_program() {
  std::error_code ec;
  return std::filesystem::read_symlink("/proc/self/exe", ec).string();
}

/// ResourceError where a sandbox is required and does not hold: another machine may do.
void enter_sandbox_of(const WorkerTask& task, [[maybe_unused]] EventWriter& events) {
  if (task.limits.sandbox == SandboxMode::kOff) return;
#if !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // they look into the process as debuggers do
  WorkerPlaces places;
  places.input = task.job.input;
  places.links_within = task.job.links_within;
  places.cache = task.job.cache.folder;
  places.only_looks = task.job.forecast;
  places.program = real_program();
  if (!places.only_looks) places.output = task.job.output;
  for (const std::string& layer : task.job.cache.layers)
    if (!layer.empty()) places.layers.push_back(layer);
  const SandboxSupport held = enter_sandbox(sandbox_rules(places));
  if (held.complete()) return;
  if (task.limits.sandbox == SandboxMode::kRequire)
    throw ResourceError("sandbox", "", "bounds on files and calls", describe_sandbox(held));
  events.write(NoteTold{
      "", {Severity::kInfo, "sandbox-degraded", "", "the model's process has " + describe_sandbox(held)}});
#endif
}

StageObserver stage_events(EventWriter& events) {
  return [&events, last = std::chrono::steady_clock::time_point{}](const Stage& stage, StageEvent event,
                                                                   double fraction, double seconds) mutable {
    const auto now = std::chrono::steady_clock::now();
    switch (event) {
      case StageEvent::kStarted:
        return events.write(StageStarted{"", stage.name});
      case StageEvent::kProgress:
        if (now - last < std::chrono::milliseconds(100)) return;
        last = now;
        return events.write(StageProgress{"", stage.name, std::clamp(fraction, 0.0, 1.0)});
      case StageEvent::kHit:
        return events.write(StageFinished{"", stage.name, "hit", 0});
      case StageEvent::kRan:
        return events.write(StageFinished{"", stage.name, "ran", seconds});
    }
  };
}

int report_error(EventWriter& events, const char* kind, const Error& e) {
  events.write(ErrorTold{"", {kind, e.file(), e.place(), e.expected(), e.found(), e.what()}});
  return kExitModelFailed;
}

CompileRequest request_of(const WorkerTask& task) {
  CompileRequest request;
  request.input = task.job.input;
  request.output = task.job.output;
  request.temporary = task.temporary;
  request.strict = task.job.strict;
  request.links_within = task.job.links_within;
  request.memory_bytes = task.limits.memory_bytes;
  request.known = task.job.known;
  request.earlier_keys = task.job.earlier_keys;
  read_profile(request.options, *task.job.profile, "options");
  return request;
}

std::unique_ptr<Store> store_of(const WorkerTask& task) {
  if (task.job.cache.folder.empty()) return std::make_unique<NullStore>();
  std::unique_ptr<Store> store = task.job.forecast ? look_into_disk_store(task.job.cache.folder)
                                                   : open_disk_store(task.job.cache.folder);
  std::vector<std::unique_ptr<CacheLayer>> layers;
  const LayerPatience patience = patience_within(static_cast<double>(task.limits.wall_s));
  for (const std::string& place : task.job.cache.layers)  // "": another model's process has left it out
    layers.push_back(place.empty() ? nullptr : open_layer(place, patience));
  if (layers.empty()) return store;
  return layered_store(std::move(store), std::move(layers),
                       task.job.forecast       ? LayerUse::kLook
                       : task.job.cache.upload ? LayerUse::kUpload
                                               : LayerUse::kFetch);
}

void report_store(EventWriter& events, Store& store) {
  for (const StoreEvent& e : store.take_events()) {
    events.write(CacheTold{"", e.code, e.text});
    if (e.layer >= 0) events.write(LayerLeftOut{"", e.layer});
  }
}

void report_outcome(EventWriter& events, const CompileOutcome& outcome) {
  for (const Note& n : outcome.notes) events.write(NoteTold{"", n});
  events.write(InputsTold{"", outcome.files, outcome.package_digest, outcome.keys});
  events.write(PackageMade{"", outcome.unchanged, outcome.package_bytes});
}

int compile(const WorkerTask& task, EventWriter& events) {
  CompileRequest request = request_of(task);
  RunContext context;
  context.threads = task.threads;
  context.cancelled = &g_cancelled;
  const std::unique_ptr<Store> store = store_of(task);
  request.size_known = [&events, options = resolve_options(request.options)](const ModelSize& size) {
    events.write(SharesTold{"", time_shares(options, size)});
  };
  request.size_known(ModelSize{});
  if (task.job.forecast) {
    for (const auto& [stage, explanation] : forecast_model(request, *store, context))
      events.write(StageExplained{"", stage, explanation});
    report_store(events, *store);
    events.write(PackageMade{"", true, 0});
    return kExitOk;
  }
  if (task.job.explain)
    request.explainer = [&events](const Stage& stage, const StageExplanation& e) {
      events.write(StageExplained{"", stage.name, e});
    };
  request.files_of_failure = [&events](const std::vector<FileRequest>& files) {
    events.write(InputsTold{"", files, {}, {}});
  };
  // What the store has to say is told while the model is compiled: models that start meanwhile, and those
  // that follow one that is killed, need not wait for a bad layer again.
  const StageObserver tell = [&, stages = stage_events(events)](const Stage& stage, StageEvent event,
                                                                double fraction, double seconds) {
    report_store(events, *store);
    stages(stage, event, fraction, seconds);
  };
  try {
    report_outcome(events, compile_model(request, *store, context, tell));
  } catch (...) {
    report_store(events, *store);
    throw;
  }
  report_store(events, *store);
  return kExitOk;
}

}  // namespace

int worker_main() {
  EventWriter events;
  const std::string input(std::istreambuf_iterator<char>(std::cin), {});
  WorkerTask task;
  try {
    task = from_json<WorkerTask>(Json::parse(input, nullptr, false), "task", true);
  } catch (const InputError&) {
    return kExitUsage;
  }
  apply_limits(task);
  try {
    enter_sandbox_of(task, events);
    return compile(task, events);
  } catch (const PermissionError& e) {
    return report_error(events, "permission", e);
  } catch (const ResourceError& e) {
    return report_error(events, "resource", e);
  } catch (const InputError& e) {
    return report_error(events, "input", e);
  } catch (const FormatError& e) {
    return report_error(events, "format", e);
  } catch (const StageError& e) {
    return report_error(events, "stage", e);
  } catch (const Cancelled&) {
    return kExitModelFailed;
  } catch (const std::bad_alloc&) {
    return report_error(events, "resource",
                        InputError(std::filesystem::path(task.job.input).filename().string(), "",
                                   fmt::format("at most {} MiB of memory", task.limits.memory_bytes >> 20),
                                   "a need for more"));
  } catch (const std::exception& e) {
    return report_error(events, "internal", StageError("texmesh", "", "", e.what())), kExitInternal;
  }
}

}  // namespace texmesh
