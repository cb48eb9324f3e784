#pragma once
#include <atomic>
#include <functional>

#include "format/base/errors.h"

namespace texmesh {

/// How a stage runs, as opposed to what it computes: nothing in here may change a result, so nothing of it is
/// ever part of a cache key.
struct RunContext {
  int threads = 1;                                // upper bound of threads a stage may use, >= 1
  std::function<void(double fraction)> progress;  // 0..1, may be empty; called from any thread
  const std::atomic<bool>* cancelled = nullptr;   // set by Ctrl-C

  void report(double fraction) const {
    if (progress) progress(fraction);
  }
  void check_cancelled() const {
    if (cancelled && cancelled->load(std::memory_order_relaxed)) throw Cancelled();
  }
};

}  // namespace texmesh
