#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "pipeline/compile_model.h"

namespace texmesh {

/// Bounds of the child process that compiles one model. 0 = none.
struct WorkerLimits {
  std::uint64_t memory_bytes = 8ull << 30;  // address space
  std::uint64_t cpu_s = 0;
  std::uint64_t wall_s = 3600;
};

/// One model for a child process.
struct WorkerJob {
  std::string input, output;
  std::string profile;  // JSON of every option
  std::string cache;    // folder, "" = none
  bool strict = false;
  int threads = 1;
};

enum class ModelResult : std::uint8_t { kOk, kUnchanged, kFailed, kInternal, kCancelled };

/// What became of a model.
struct WorkerReport {
  ModelResult result = ModelResult::kInternal;
  std::uint64_t package_bytes = 0, peak_memory_bytes = 0;
  double seconds = 0;
  std::string error_kind, error_file, error_place, error_expected, error_found, error_message;
  int stages_ran = 0, stages_hit = 0;
};

/// Told of every event line of a job's child (SPEC of the lines: schemas/event.v1.schema.json), in order.
using EventSink = std::function<void(std::size_t job, const std::string& json_line)>;
using FinishSink = std::function<void(std::size_t job, const WorkerReport& report)>;

/// Compiles the jobs, each in a fresh child process of this executable (posix_spawn, never a fork of a
/// threaded parent), at most `parallel` side by side, and returns a report per job in their order. A child
/// that dies, hangs or outgrows its limits costs its own model only. SIGINT and SIGTERM end all children
/// within two seconds and leave no temporary file; what had not finished is kCancelled. stop_on_failure: no
/// further child starts after a failure.
std::vector<WorkerReport> run_workers(const std::vector<WorkerJob>& jobs, int parallel,
                                      const WorkerLimits& limits, bool stop_on_failure, const EventSink& sink,
                                      const FinishSink& finished);

/// The child's side: reads a job from standard input, writes event lines to standard output, returns the exit
/// code.
int worker_main();

}  // namespace texmesh
