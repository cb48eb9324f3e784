#pragma once
#include <chrono>
#include <map>
#include <memory>
#include <variant>

#include "pipeline/compile/workers/sandbox.h"
#include "pipeline/graph/graph_run.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {

// What a run and its workers tell each other, one description each: the task on a worker's standard input,
// event lines on its standard output. Users see the events of `texmesh compile --json`
// (schemas/event.v1.schema.json); `model` is
// "" until the run has put the model's name in.

/// Bounds of the child process that compiles one model. 0 = none.
struct WorkerLimits {
  std::uint64_t memory_bytes = 8ull << 30;  // address space
  std::uint64_t cpu_s = 0;
  std::uint64_t wall_s = 3600;
  SandboxMode sandbox = SandboxMode::kAuto;
  static void fields(auto& s, auto&& v) {
    v("memory_bytes", s.memory_bytes, "");
    v("cpu_s", s.cpu_s, "");
    v("wall_s", s.wall_s, "");
    v("sandbox", s.sandbox, "");
  }
};

/// Where results are kept.
struct CacheSettings {
  std::string folder;               // "" = keep nothing
  std::vector<std::string> layers;  // asked behind the folder: folders and URLs
  bool upload = false;              // put what was computed into the layers that are URLs
  static void fields(auto& s, auto&& v) {
    v("cache", s.folder, kNamesFile, "");
    v("layers", s.layers, kNamesFile, "");
    v("upload", s.upload, "");
  }
};

/// One model for a child process.
struct WorkerJob {
  std::string input, output;
  std::shared_ptr<const std::string> profile;  // JSON of every option; jobs may share it
  CacheSettings cache;
  bool strict = false;
  bool explain = false;                   // say of every stage why it runs or not
  bool forecast = false;                  // only say so: run and write nothing
  std::vector<std::string> links_within;  // see CompileRequest
  std::vector<FileRequest> known;         // of an earlier run, see CompileRequest
  StageKeys earlier_keys;
  std::uint64_t predicted_memory_bytes = 0;  // peak, from earlier runs or a guess
  double predicted_s = 0;
  /// What is predicted is of use to the pool alone.
  static void fields(auto& s, auto&& v) {
    v("input", s.input, kNamesFile, "");
    v("output", s.output, kNamesFile, "");
    v("profile", s.profile, "");
    CacheSettings::fields(s.cache, v);
    v("strict", s.strict, "");
    v("explain", s.explain, "");
    v("forecast", s.forecast, "");
    v("links_within", s.links_within, kNamesFile, "");
    v("known", s.known, "");
    v("keys", s.earlier_keys, "");
  }
};

/// What a worker is told. Of the job's layers "" is left out, so that the others keep their numbers.
struct WorkerTask {
  WorkerJob job;
  WorkerLimits limits;
  std::string temporary;  // see CompileRequest
  int threads = 1;
  int parent = 0;  // the process that waits for the answer
  static void fields(auto& s, auto&& v) {
    WorkerJob::fields(s.job, v);
    WorkerLimits::fields(s.limits, v);
    v("temporary", s.temporary, kNamesFile, "");
    v("threads", s.threads, "");
    v("parent", s.parent, "");
  }
};

/// The better ones first.
enum class ModelResult : std::uint8_t { kOk, kUnchanged, kFailed, kInternal, kCancelled };
template <>
struct EnumNames<ModelResult> {
  static constexpr std::array<std::string_view, 5> names{"ok", "unchanged", "failed", "internal-error",
                                                         "cancelled"};
};

/// Why a model failed.
struct ModelError {
  std::string kind, file, place, expected, found, message;
  friend bool operator==(const ModelError&, const ModelError&) = default;
  static void fields(auto& s, auto&& v) {
    v("kind", s.kind, FieldRule{.words = "input|format|stage|resource|permission|internal"}, "");
    v("file", s.file, "");
    v("place", s.place, "");
    v("expected", s.expected, "");
    v("found", s.found, "");
    v("message", s.message, "");
  }
};

/// What became of a model, in numbers.
struct ModelNumbers {
  ModelResult result = ModelResult::kInternal;
  bool ran = false;  // false: known from an earlier run (up to date, or a known failure), or never started
  std::uint64_t bytes = 0, peak_memory_bytes = 0;  // bytes: of the package
  double seconds = 0;
  int stages_ran = 0, stages_hit = 0;
  bool ok() const { return result == ModelResult::kOk || result == ModelResult::kUnchanged; }
  static void fields(auto& s, auto&& v) {
    constexpr FieldRule kCount{.range = Range{0, 1e6}};
    v("result", s.result, "");
    v("ran", s.ran, "false: known from an earlier run, or never started");
    v("bytes", s.bytes, "of the package");
    v("seconds", s.seconds, kSeconds, "");
    v("peak_memory_bytes", s.peak_memory_bytes, "");
    v("stages_ran", s.stages_ran, kCount, "");
    v("stages_from_cache", s.stages_hit, kCount, "");
  }
};

/// An event is a record whose JSON begins with the event's name and the model.
template <class Event>
requires requires { Event::kEvent; }
struct RecordFields<Event> {
  static void fields(auto& s, auto&& v) {
    v("event", Constant{Event::kEvent}, "");
    v("model", s.model, "as the run names the model");
    Event::fields(s, v);
  }
};

struct ModelStarted {
  static constexpr const char* kEvent = "model-started";
  std::string model, output;
  static void fields(auto& s, auto&& v) { v("output", s.output, ""); }
};

struct StageStarted {
  static constexpr const char* kEvent = "stage-started";
  std::string model, stage;
  static void fields(auto& s, auto&& v) { v("stage", s.stage, kNotEmpty, ""); }
};

struct StageProgress {
  static constexpr const char* kEvent = "stage-progress";
  std::string model, stage;
  double fraction = 0;
  static void fields(auto& s, auto&& v) {
    v("stage", s.stage, kNotEmpty, "");
    v("fraction", s.fraction, Range{0, 1}, "");
  }
};

struct StageFinished {
  static constexpr const char* kEvent = "stage-finished";
  std::string model, stage, result;
  double seconds = 0;
  static void fields(auto& s, auto&& v) {
    v("stage", s.stage, kNotEmpty, "");
    v("result", s.result, FieldRule{.words = "ran|hit"}, "hit = from the cache");
    v("seconds", s.seconds, kSeconds, "");
  }
};

struct StageExplained {
  static constexpr const char* kEvent = "stage-explained";
  std::string model, stage;
  StageExplanation explanation;
  static void fields(auto& s, auto&& v) {
    v("stage", s.stage, kNotEmpty, "");
    StageExplanation::fields(s.explanation, v);
  }
};

struct CacheTold {
  static constexpr const char* kEvent = "cache";
  std::string model, code, text;
  static void fields(auto& s, auto&& v) {
    v("code", s.code, FieldRule{.words = "cache-entry-damaged|cache-layer-unreachable|cache-not-written"},
      "");
    v("text", s.text, "");
  }
};

struct NoteTold {
  static constexpr const char* kEvent = "note";
  std::string model;
  Note note;
  static void fields(auto& s, auto&& v) { RecordFields<Note>::fields(s.note, v); }
};

struct ErrorTold {
  static constexpr const char* kEvent = "error";
  std::string model;
  ModelError error;
  static void fields(auto& s, auto&& v) { ModelError::fields(s.error, v); }
};

/// The package is there.
struct PackageMade {
  static constexpr const char* kEvent = "result";
  std::string model;
  bool unchanged = false;
  std::uint64_t bytes = 0;
  static void fields(auto& s, auto&& v) {
    v("unchanged", s.unchanged, "");
    v("bytes", s.bytes, "");
  }
};

struct ModelFinished {
  static constexpr const char* kEvent = "model-finished";
  std::string model, output;
  ModelNumbers numbers;
  static void fields(auto& s, auto&& v) {
    v("output", s.output, "");
    ModelNumbers::fields(s.numbers, v);
  }
};

struct RunFinished {
  std::uint64_t models = 0, compiled = 0, unchanged = 0, failed = 0, cancelled = 0, warned = 0;
  double seconds = 0;
  std::vector<std::string> stale;
  static void fields(auto& s, auto&& v) {
    v("event", Constant{"summary"}, "");
    v("models", s.models, "");
    v("compiled", s.compiled, "");
    v("unchanged", s.unchanged, "");
    v("failed", s.failed, "");
    v("cancelled", s.cancelled, "");
    v("warned", s.warned, kMayMiss, "models with a warning that holds");
    v("seconds", s.seconds, kSeconds, "");
    v("stale", s.stale, kMayMiss, "packages in the output folder that no model makes: paths within it");
  }
};

/// For the parent alone: what the package, or the failure, depends on.
struct InputsTold {
  static constexpr const char* kEvent = "inputs";
  std::string model;
  std::vector<FileRequest> files;
  std::optional<Sha256> package;
  StageKeys keys;
  static void fields(auto& s, auto&& v) {
    v("files", s.files, "");
    v("package", s.package, "");
    v("keys", s.keys, "");
  }
};

/// For the parent alone: a layer does not work; its number in the task.
struct LayerLeftOut {
  static constexpr const char* kEvent = "layer-left-out";
  std::string model;
  int layer = -1;
  static void fields(auto& s, auto&& v) { v("layer", s.layer, ""); }
};

/// For the run alone: each stage's share of a model's time (time_shares()).
struct SharesTold {
  static constexpr const char* kEvent = "shares";
  std::string model;
  std::map<std::string, double> shares;
  static void fields(auto& s, auto&& v) { v("shares", s.shares, Range{0, 1}, ""); }
};

/// What a worker tells.
using WorkerEvent = std::variant<StageStarted, StageProgress, StageFinished, StageExplained, CacheTold,
                                 NoteTold, ErrorTold, PackageMade, InputsTold, LayerLeftOut, SharesTold>;

/// Nothing for a line that is no event: whoever has taken over a child writes what he likes.
std::optional<WorkerEvent> read_event(const std::string& line);

/// event.v1.
DocumentSchema event_schema();

/// One stage in the course of a model, in seconds since the pool began.
struct StageSpan {
  std::string stage;
  double start_s = 0, end_s = 0;
  bool hit = false;
  bool running = false;  // the model ended, by a limit or a crash, before the stage did
};

/// A value that few owners have: it takes a pointer until somebody is about to change it. Copies are of the
/// value.
template <class T>
class PointerOnDemand {
 public:
  PointerOnDemand() = default;
  PointerOnDemand(const PointerOnDemand& other)
      : value_(other.value_ ? std::make_unique<T>(*other.value_) : nullptr) {}
  PointerOnDemand(PointerOnDemand&&) noexcept = default;
  PointerOnDemand& operator=(PointerOnDemand other) noexcept { return value_.swap(other.value_), *this; }

  const T& operator*() const {
    static const T none;
    return value_ ? *value_ : none;
  }
  const T* operator->() const { return &**this; }
  /// Makes the value.
  T* operator->() {
    if (!value_) value_ = std::make_unique<T>();
    return value_.get();
  }

 private:
  std::unique_ptr<T> value_;
};

/// A warning, or a note of something that the package lacks: told in every run while it holds.
bool is_told_always(const Note& note);
inline constexpr std::size_t kMostToldNotes = 20;

/// What only a model that ran, or that failed, has.
struct WorkerDetails {
  ModelError error;                // of empty texts when nothing went wrong
  std::vector<FileRequest> files;  // as CompileOutcome; empty after a failure
  StageKeys keys;
  std::vector<int> layers_left_out;  // numbers in CacheSettings::layers of those that did not work
  std::vector<StageSpan> spans;
  Notes told;  // is_told_always(), at most kMostToldNotes and one that counts the others
};

/// What became of a model. A run that does nothing holds one of each model of the collection.
struct WorkerReport : ModelNumbers {
  int lane = 0;  // which of the side-by-side places it ran in, from 0
  Sha256 package_digest{};
  double start_s = 0;
  // What the model took when its package was made, where this run did not make it; 0 = not known.
  double made_s = 0;
  std::uint64_t made_memory_bytes = 0;
  PointerOnDemand<WorkerDetails> more;
};

/// Told of every event of a job's child that is not for the pool alone, in order.
using EventSink = std::function<void(std::size_t job, WorkerEvent event)>;
using FinishSink = std::function<void(std::size_t job, const WorkerReport& report)>;

struct PoolSettings {
  int processors = 1;
  std::uint64_t memory_bytes = 0;  // bound of the sum of the predicted peaks that run side by side; 0 = none
  WorkerLimits limits;
  bool stop_on_failure = false;  // no further child starts after a failure
};

/// A running child process. Its owner waits for `pid` and closes the descriptors.
struct ChildProcess {
  pid_t pid = -1;
  int out = -1, err = -1;  // its standard output and error; reading them does not block
  std::chrono::steady_clock::time_point start;
};

/// Where the workers of a run come from. Where there are several, `texmesh worker-origin` loads its libraries
/// once, which takes a start 20 ms, and each worker is a copy of it as it was then: it has read no model, so
/// nothing of one comes to another. Its children are this process's. Not for concurrent use.
class WorkerOrigin {
 public:
  explicit WorkerOrigin(std::size_t workers);
  ~WorkerOrigin();
  WorkerOrigin(const WorkerOrigin&) = delete;
  WorkerOrigin& operator=(const WorkerOrigin&) = delete;
  /// A worker that reads `input` as the whole of its standard input, in worker_environment(). All where the
  /// origin is gone are started anew. Throws ResourceError where the system gives no process or no files.
  ChildProcess start(const std::string& input);

 private:
  pid_t copy(const std::array<int, 3>& files);
  void end();
  pid_t pid_ = -1;
  int socket_ = -1;
};

/// Compiles the jobs, each in a child process of its own (WorkerOrigin). Returns a report per job, in the
/// order of the jobs.
/// - Jobs that are predicted to take longest start first. At most `processors` run side by side, fewer when
///   the predicted peaks do not fit the memory; one always runs. The last jobs get the free processors as
///   threads.
/// - A child that dies, hangs or exceeds its limits costs its own model only.
/// - A model whose child cannot start waits while others run; where none does, it fails.
/// - A cache layer that did not work for one child is not asked by children that start within a minute.
/// - SIGINT and SIGTERM end all children within two seconds and leave no temporary file. Jobs that had not
///   ended are kCancelled.
std::vector<WorkerReport> run_workers(const std::vector<WorkerJob>& jobs, const PoolSettings& settings,
                                      const EventSink& sink, const FinishSink& finished);

/// Enters what an event says about the model into the report. False when the event is for the pool alone.
bool apply_event(const WorkerEvent& event, double now_s, WorkerReport& report);

/// This process's variables for a worker, as NAME=value. In it glibc asks the system for large pages (2 MiB
/// on x86-64), unless GLIBC_TUNABLES is set already: 2 % less time for small models, 4 % for 100,000
/// triangles, and 2 to 6 % more memory.
std::vector<std::string> worker_environment();

/// The worker's side of compiling in child processes: reads a task from standard input, writes event lines to
/// standard output, returns the exit code.
int worker_main();

/// `texmesh worker-origin`: copies itself for every message on its standard input, a socket, until that ends.
int worker_origin_main();

}  // namespace texmesh
