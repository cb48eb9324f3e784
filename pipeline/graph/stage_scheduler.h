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
  /// `is_ready` is called under the scheduler's lock, `run` is not. A task can become ready only by another's
  /// end.
  StageScheduler(std::size_t tasks, std::function<bool(std::size_t)> is_ready,
                 std::function<void(std::size_t)> run)
      : is_ready_(std::move(is_ready)), run_(std::move(run)), tasks_(tasks) {}

  /// Returns when all tasks have run, or, after one has failed or where none is ready, when those that run
  /// have ended. Rethrows the first task's error, by number.
  void run_all(int threads);

  /// Tasks that have not run because they never became ready.
  std::vector<std::size_t> left() const;

 private:
  struct Task {
    bool is_taken = false;
    std::exception_ptr error;
  };
  void work();

  std::function<bool(std::size_t)> is_ready_;
  std::function<void(std::size_t)> run_;
  std::mutex mutex_;  // of what follows
  std::condition_variable task_ended_;
  std::vector<Task> tasks_;
  int running_ = 0;
  bool has_failed_ = false;
};

}  // namespace texmesh
