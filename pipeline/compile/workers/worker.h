#pragma once
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/compile/workers/worker_messages.h"

namespace texmesh {

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

/// What only a model that ran, or that failed, has.
struct WorkerDetails {
  ModelError error;                // of empty texts when nothing went wrong
  std::vector<FileRequest> files;  // as CompileOutcome; empty after a failure
  StageKeys keys;
  std::vector<int> layers_left_out;  // numbers in CacheSettings::layers of those that did not work
  std::vector<StageSpan> spans;
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

/// Enters what an event says about the model into the report. False when the event is for the pool alone.
bool apply_event(const WorkerEvent& event, double now_s, WorkerReport& report);

/// This process's variables for a worker, as NAME=value. With `large_pages` glibc asks the system for large
/// pages (2 MiB on x86-64), unless GLIBC_TUNABLES is set already.
std::vector<std::string> worker_environment(bool large_pages);

/// The worker's side of compiling in child processes: reads a task from standard input, writes event lines to
/// standard output, returns the exit code.
int worker_main();

}  // namespace texmesh
