#pragma once
#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "format/base/fields.h"
#include "pipeline/compile/workers/sandbox/sandbox.h"
#include "pipeline/compile/workers/seldom.h"
#include "pipeline/graph/key.h"
#include "pipeline/io/file_request.h"

namespace texmesh {

/// Bounds of the child process that compiles one model. 0 = none.
struct WorkerLimits {
  std::uint64_t memory_bytes = 8ull << 30;  // address space
  std::uint64_t cpu_s = 0;
  std::uint64_t wall_s = 3600;
  SandboxMode sandbox = SandboxMode::kAuto;
};

/// Where results are kept.
struct CacheSettings {
  std::string folder;               // "" = keep nothing
  std::vector<std::string> layers;  // asked behind the folder: folders and URLs
  bool upload = false;              // put what was computed into the layers that are URLs
};

/// One model for a child process.
struct WorkerJob {
  std::string input, output;
  std::shared_ptr<const std::string> profile;  // JSON of every option; jobs may share it
  CacheSettings cache;
  bool strict = false;
  bool explain = false;            // say of every stage why it runs or not
  bool forecast = false;           // only say so: run and write nothing
  std::vector<FileRequest> known;  // of an earlier run, see CompileRequest
  StageKeys earlier_keys;
  std::uint64_t predicted_memory_bytes = 0;  // peak, from earlier runs or a guess
  double predicted_s = 0;
};

enum class ModelResult : std::uint8_t { kOk, kUnchanged, kFailed, kInternal, kCancelled };
template <>
struct EnumNames<ModelResult> {
  static constexpr std::array<std::string_view, 5> names{"ok", "unchanged", "failed", "internal-error",
                                                         "cancelled"};
};

/// One stage in the course of a model, in seconds since the pool began.
struct StageSpan {
  std::string stage;
  double start_s = 0, end_s = 0;
  bool hit = false;
  bool running = false;  // the model ended, by a limit or a crash, before the stage did
};

/// Why a model failed.
struct ModelError {
  std::string kind, file, place, expected, found, message;
};

/// What only a model that ran, or that failed, has.
struct WorkerDetails {
  ModelError error;                // of empty texts when nothing went wrong
  std::vector<FileRequest> files;  // as CompileOutcome; empty after a failure
  StageKeys keys;
  std::vector<int> layers_left_out;  // numbers in CacheSettings::layers of those that did not work
  std::vector<StageSpan> spans;
};

/// What became of a model. A run that does nothing holds one of each model of the collection.
struct WorkerReport {
  ModelResult result = ModelResult::kInternal;
  bool ran = false;  // false: known from an earlier run (up to date, or a known failure), or never started
  int lane = 0;      // which of the side-by-side places it ran in, from 0
  std::uint64_t package_bytes = 0, peak_memory_bytes = 0;
  Sha256 package_digest{};
  double start_s = 0, seconds = 0;
  // What the model took when its package was made, where this run did not make it; 0 = not known.
  double made_s = 0;
  std::uint64_t made_memory_bytes = 0;
  int stages_ran = 0, stages_hit = 0;
  Seldom<WorkerDetails> more;
  bool ok() const { return result == ModelResult::kOk || result == ModelResult::kUnchanged; }
};

/// Told of every event line of a job's child (SPEC of the lines: schemas/event.v1.schema.json), in order.
using EventSink = std::function<void(std::size_t job, const std::string& json_line)>;
using FinishSink = std::function<void(std::size_t job, const WorkerReport& report)>;

struct PoolSettings {
  int processors = 1;
  std::uint64_t memory_bytes = 0;  // bound of the sum of the predicted peaks that run side by side; 0 = none
  WorkerLimits limits;
  bool stop_on_failure = false;  // no further child starts after a failure
};

/// Compiles the jobs, each in a fresh child process of texmesh (posix_spawn, never a fork of a threaded
/// parent). Returns a report per job, in the order of the jobs.
/// - Jobs that are predicted to take longest start first. At most `processors` run side by side, fewer when
///   the predicted peaks do not fit the memory; one always runs. The last jobs get the free processors as
///   threads.
/// - A child that dies, hangs or exceeds its limits costs its own model only.
/// - A cache layer that did not work for one child is not asked by children that start within a minute.
/// - SIGINT and SIGTERM end all children within two seconds and leave no temporary file. Jobs that had not
///   ended are kCancelled.
std::vector<WorkerReport> run_workers(const std::vector<WorkerJob>& jobs, const PoolSettings& settings,
                                      const EventSink& sink, const FinishSink& finished);

}  // namespace texmesh
