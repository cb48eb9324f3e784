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

#include "pipeline/cache/cache_layer.h"
#include "pipeline/cache/disk_store.h"
#include "pipeline/compile/compile_model.h"
#include "pipeline/compile/profile.h"
#include "pipeline/compile/workers/sandbox/worker_rules.h"
#include "pipeline/compile/workers/worker_child.h"
#include "pipeline/compile/workers/worker_messages.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/machine/owner_mark.h"
#include "pipeline/io/resource_error.h"
#include "pipeline/io/wire_text.h"

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

/// `more`: from the soft limit, which a signal tells of, to the hard one, which kills.
void limit(int resource, std::uint64_t value, std::uint64_t more = 0) {
  if (value == 0) return;
  const rlimit r{value, value + more};
  ::setrlimit(static_cast<__rlimit_resource>(resource), &r);
}

void apply_limits(const Json& job) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != job.value("parent", pid_t{0})) ::_exit(kExitInternal);  // it died before the line above
  owner_mark();  // looks at the machine while this process may still look
  const rlimit no_core{0, 0};
  ::setrlimit(RLIMIT_CORE, &no_core);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)  // sanitizers map terabytes of shadow
  limit(RLIMIT_AS, job.value("memory_bytes", std::uint64_t{0}));
#endif
  limit(RLIMIT_CPU, job.value("cpu_s", std::uint64_t{0}), 1);
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
void enter_sandbox_of(const Json& job, [[maybe_unused]] EventWriter& events) {
  const std::string mode = job.value("sandbox", "off");
  if (mode == enum_name(SandboxMode::kOff)) return;
#if !defined(__SANITIZE_ADDRESS__) && \
    !defined(__SANITIZE_THREAD__)  // they look into the process as debuggers do
  WorkerPlaces places;
  places.input = from_wire(job.at("input").get<std::string>());
  places.cache = from_wire(job.at("cache").get<std::string>());
  places.only_looks = job.at("forecast").get<bool>();
  places.program = real_program();
  if (!places.only_looks) places.output = from_wire(job.at("output").get<std::string>());
  for (const Json& layer : job.at("layers"))
    if (layer.is_string()) places.layers.push_back(from_wire(layer.get<std::string>()));
  const SandboxSupport held = enter_sandbox(sandbox_rules(places));
  if (held.complete()) return;
  if (mode == enum_name(SandboxMode::kRequire))
    throw ResourceError("sandbox", "", "bounds on files and calls", describe_sandbox(held));
  events.write({{"event", "note"},
                {"severity", "info"},
                {"code", "sandbox-degraded"},
                {"place", ""},
                {"text", "the model's process has " + describe_sandbox(held)}});
#endif
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

Json explanation_event(const std::string& stage, const StageExplanation& e) {
  static constexpr const char* kVerdicts[] = {"hit", "runs", "unknown"};
  Json changes = Json::array();
  for (const KeyChange& c : e.changes) changes.push_back({{"part", c.label}, {"from", c.from}, {"to", c.to}});
  Json event{{"event", "stage-explained"},
             {"stage", stage},
             {"verdict", kVerdicts[static_cast<int>(e.verdict)]},
             {"history", e.has_history},
             {"changes", std::move(changes)}};
  if (!e.waits_for.empty()) event["waits_for"] = e.waits_for;
  return event;
}

CompileRequest request_of(const Json& job) {
  CompileRequest request;
  request.input = from_wire(job.at("input").get<std::string>());
  request.output = from_wire(job.at("output").get<std::string>());
  request.temporary = from_wire(job.at("temporary").get<std::string>());
  request.strict = job.at("strict").get<bool>();
  request.memory_bytes = job.value("memory_bytes", std::uint64_t{0});
  request.known = files_from_json(job.at("known").get<std::string>());
  for (const auto& [stage, key] : job.at("keys").items())
    if (Sha256 digest; from_hex(key.get<std::string>(), digest)) request.earlier_keys[stage] = digest;
  read_profile(request.options, job.at("profile").get<std::string>(), "options");
  return request;
}

std::unique_ptr<Store> store_of(const Json& job) {
  const std::string cache = from_wire(job.at("cache").get<std::string>());
  if (cache.empty()) return std::make_unique<NullStore>();
  const bool only_look = job.at("forecast").get<bool>();
  std::unique_ptr<Store> store = only_look ? look_into_disk_store(cache) : open_disk_store(cache);
  std::vector<std::unique_ptr<CacheLayer>> layers;
  const LayerPatience patience = patience_within(job.at("wall_s").get<double>());
  for (const Json& place : job.at("layers"))  // null: another model's process has left it out
    layers.push_back(place.is_string() ? open_layer(from_wire(place.get<std::string>()), patience) : nullptr);
  if (layers.empty()) return store;
  return layered_store(std::move(store), std::move(layers),
                       only_look                      ? LayerUse::kLook
                       : job.at("upload").get<bool>() ? LayerUse::kUpload
                                                      : LayerUse::kFetch);
}

void report_store(EventWriter& events, Store& store) {
  for (const StoreEvent& e : store.take_events()) {
    events.write({{"event", "cache"}, {"code", e.code}, {"text", e.text}});
    if (e.layer >= 0) events.write({{"event", "layer-left-out"}, {"layer", e.layer}});
  }
}

void report_outcome(EventWriter& events, const CompileOutcome& outcome) {
  for (const Note& n : outcome.notes)
    events.write({{"event", "note"},
                  {"severity", n.severity == Severity::kWarning ? "warning" : "info"},
                  {"code", n.code},
                  {"place", n.place},
                  {"text", n.text}});
  Json keys = Json::object();
  for (const auto& [stage, key] : outcome.keys) keys[stage] = to_hex(key);
  events.write({{"event", "inputs"},
                {"files", files_to_json(outcome.files)},
                {"package", to_hex(outcome.package_digest)},
                {"keys", keys}});
  events.write({{"event", "result"}, {"unchanged", outcome.unchanged}, {"bytes", outcome.package_bytes}});
}

int compile(const Json& job, EventWriter& events) {
  CompileRequest request = request_of(job);
  RunContext context;
  context.threads = job.at("threads").get<int>();
  context.cancelled = &g_cancelled;
  const std::unique_ptr<Store> store = store_of(job);
  if (job.at("forecast").get<bool>()) {
    for (const auto& [stage, explanation] : forecast_model(request, *store, context))
      events.write(explanation_event(stage, explanation));
    report_store(events, *store);
    events.write({{"event", "result"}, {"unchanged", true}, {"bytes", 0}});
    return kExitOk;
  }
  if (job.at("explain").get<bool>())
    request.explainer = [&events](const Stage& stage, const StageExplanation& e) {
      events.write(explanation_event(stage.name, e));
    };
  request.files_of_failure = [&events](const std::vector<FileRequest>& files) {
    events.write(
        {{"event", "inputs"}, {"files", files_to_json(files)}, {"package", ""}, {"keys", Json::object()}});
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
  const Json job = Json::parse(input, nullptr, false);
  if (!job.is_object()) return kExitUsage;
  apply_limits(job);
  try {
    enter_sandbox_of(job, events);
    return compile(job, events);
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
    const std::string limit_text =
        std::to_string(job.value("memory_bytes", std::uint64_t{0}) >> 20) + " MiB of memory";
    return report_error(
        events, "resource",
        InputError(std::filesystem::path(from_wire(job.value("input", ""))).filename().string(), "",
                   "at most " + limit_text, "a need for more"));
  } catch (const std::exception& e) {
    return report_error(events, "internal", StageError("texmesh", "", "", e.what())), kExitInternal;
  }
}

}  // namespace texmesh
