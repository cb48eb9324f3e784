#pragma once
#include <condition_variable>
#include <cstddef>
#include <exception>
#include <functional>
#include <mutex>
#include <vector>

namespace texmesh {

/// Runs numbered tasks on several threads, each once, as soon as it is ready.
class StageScheduler {
 public:
  /// `is_ready` is called under the scheduler's lock, `run` is not. A task becomes ready only when another
  /// task ends.
  StageScheduler(std::size_t tasks, std::function<bool(std::size_t)> is_ready,
                 std::function<void(std::size_t)> run)
      : is_ready_(std::move(is_ready)), run_(std::move(run)), tasks_(tasks) {}

  /// Returns when all tasks have run. After a failure, or when no task is ready, returns as soon as the
  /// running tasks have ended. Rethrows the error of the first task that failed, by number.
  void run_all(int threads);

  /// Tasks that have not run because they never became ready.
  std::vector<std::size_t> tasks_not_run() const;

 private:
  struct Task {
    bool is_taken = false;
    std::exception_ptr error;
  };
  void run_ready_tasks();

  std::function<bool(std::size_t)> is_ready_;
  std::function<void(std::size_t)> run_;
  std::mutex mutex_;  // of what follows
  std::condition_variable task_ended_;
  std::vector<Task> tasks_;
  int running_ = 0;
  bool has_failed_ = false;
};

}  // namespace texmesh
