#pragma once
#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "pipeline/compile/workers/sandbox.h"
#include "pipeline/graph/graph_run.h"
#include "pipeline/io/file_stamp.h"
#include "pipeline/io/record.h"

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
  template <class S, class V>
  static void fields(S& s, V&& v) {
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
  template <class S, class V>
  static void fields(S& s, V&& v) {
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
  template <class S, class V>
  static void fields(S& s, V&& v) {
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
  template <class S, class V>
  static void fields(S& s, V&& v) {
    WorkerJob::fields(s.job, v);
    WorkerLimits::fields(s.limits, v);
    v("temporary", s.temporary, kNamesFile, "");
    v("threads", s.threads, "");
    v("parent", s.parent, "");
  }
};

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
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("kind", s.kind, FieldRule{.words = "input|format|stage|resource|internal"}, "");
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
  template <class S, class V>
  static void fields(S& s, V&& v) {
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
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("event", Constant{Event::kEvent}, "");
    v("model", s.model, "as the run names the model");
    Event::fields(s, v);
  }
};

struct ModelStarted {
  static constexpr const char* kEvent = "model-started";
  std::string model, output;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("output", s.output, "");
  }
};

struct StageStarted {
  static constexpr const char* kEvent = "stage-started";
  std::string model, stage;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("stage", s.stage, kNotEmpty, "");
  }
};

struct StageProgress {
  static constexpr const char* kEvent = "stage-progress";
  std::string model, stage;
  double fraction = 0;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("stage", s.stage, kNotEmpty, "");
    v("fraction", s.fraction, Range{0, 1}, "");
  }
};

struct StageFinished {
  static constexpr const char* kEvent = "stage-finished";
  std::string model, stage, result;
  double seconds = 0;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("stage", s.stage, kNotEmpty, "");
    v("result", s.result, FieldRule{.words = "ran|hit"}, "hit = from the cache");
    v("seconds", s.seconds, kSeconds, "");
  }
};

struct StageExplained {
  static constexpr const char* kEvent = "stage-explained";
  std::string model, stage;
  StageExplanation explanation;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("stage", s.stage, kNotEmpty, "");
    StageExplanation::fields(s.explanation, v);
  }
};

struct CacheTold {
  static constexpr const char* kEvent = "cache";
  std::string model, code, text;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("code", s.code, FieldRule{.words = "cache-entry-damaged|cache-layer-unreachable|cache-not-written"},
      "");
    v("text", s.text, "");
  }
};

struct NoteTold {
  static constexpr const char* kEvent = "note";
  std::string model;
  Note note;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    RecordFields<Note>::fields(s.note, v);
  }
};

struct ErrorTold {
  static constexpr const char* kEvent = "error";
  std::string model;
  ModelError error;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    ModelError::fields(s.error, v);
  }
};

/// The package is there.
struct PackageMade {
  static constexpr const char* kEvent = "result";
  std::string model;
  bool unchanged = false;
  std::uint64_t bytes = 0;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("unchanged", s.unchanged, "");
    v("bytes", s.bytes, "");
  }
};

struct ModelFinished {
  static constexpr const char* kEvent = "model-finished";
  std::string model, output;
  ModelNumbers numbers;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("output", s.output, "");
    ModelNumbers::fields(s.numbers, v);
  }
};

struct RunFinished {
  std::uint64_t models = 0, compiled = 0, unchanged = 0, failed = 0, cancelled = 0;
  double seconds = 0;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("event", Constant{"summary"}, "");
    v("models", s.models, "");
    v("compiled", s.compiled, "");
    v("unchanged", s.unchanged, "");
    v("failed", s.failed, "");
    v("cancelled", s.cancelled, "");
    v("seconds", s.seconds, kSeconds, "");
  }
};

/// For the parent alone: what the package, or the failure, depends on.
struct InputsTold {
  static constexpr const char* kEvent = "inputs";
  std::string model;
  std::vector<FileRequest> files;
  std::optional<Sha256> package;
  StageKeys keys;
  template <class S, class V>
  static void fields(S& s, V&& v) {
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
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("layer", s.layer, "");
  }
};

/// For the run alone: each stage's share of a model's time (Stage::time_share).
struct SharesTold {
  static constexpr const char* kEvent = "shares";
  std::string model;
  std::map<std::string, double> shares;
  template <class S, class V>
  static void fields(S& s, V&& v) {
    v("shares", s.shares, Range{0, 1}, "");
  }
};

/// What a worker tells.
using WorkerEvent = std::variant<StageStarted, StageProgress, StageFinished, StageExplained, CacheTold,
                                 NoteTold, ErrorTold, PackageMade, InputsTold, LayerLeftOut, SharesTold>;

/// Nothing for a line that is no event: whoever has taken over a child writes what he likes.
std::optional<WorkerEvent> read_event(const std::string& line);

/// event.v1.
DocumentSchema event_schema();

}  // namespace texmesh
