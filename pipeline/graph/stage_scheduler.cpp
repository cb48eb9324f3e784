#include "pipeline/graph/stage_scheduler.h"

#include <thread>

namespace texmesh {

void StageScheduler::run_all(int threads) {
  std::vector<std::thread> others;
  for (int i = 1; i < threads; ++i) others.emplace_back([this] { run_ready_tasks(); });
  run_ready_tasks();
  for (std::thread& t : others) t.join();
  for (const Task& task : tasks_)
    if (task.error) std::rethrow_exception(task.error);
}

std::vector<std::size_t> StageScheduler::tasks_not_run() const {
  std::vector<std::size_t> left;
  for (std::size_t i = 0; i < tasks_.size(); ++i)
    if (!tasks_[i].is_taken) left.push_back(i);
  return left;
}

/// One thread: takes the first ready task until none is left.
void StageScheduler::run_ready_tasks() {
  std::unique_lock lock(mutex_);
  for (;;) {
    std::size_t next = tasks_.size();
    bool any_left = false;
    for (std::size_t i = 0; i < tasks_.size() && next == tasks_.size(); ++i) {
      if (tasks_[i].is_taken) continue;
      any_left = true;
      if (is_ready_(i)) next = i;
    }
    if (!any_left || has_failed_) return;
    if (next == tasks_.size()) {
      if (running_ == 0) return;  // a circle, or something that nobody gives
      task_ended_.wait(lock);
      continue;
    }
    tasks_[next].is_taken = true;
    ++running_;
    lock.unlock();
    std::exception_ptr error;
    try {
      run_(next);
    } catch (...) {
      error = std::current_exception();
    }
    lock.lock();
    --running_;
    tasks_[next].error = error;
    has_failed_ = has_failed_ || error;
    task_ended_.notify_all();
  }
}

}  // namespace texmesh
