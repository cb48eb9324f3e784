#pragma once
#include <functional>
#include <string>

#include "format/base/fields.h"

namespace texmesh {

/// One of the parts that a collection is split into, counted from 0.
struct Shard {
  int index = 0, count = 1;
  friend bool operator==(const Shard&, const Shard&) = default;
  static void fields(auto& s, auto&& v) {
    v("index", s.index, Range{0, 999'999}, "");
    v("count", s.count, Range{1, 1'000'000}, "");
  }
};

/// The value of an environment variable; null where it is not set (std::getenv).
using EnvironmentLookup = std::function<const char*(const char* name)>;

/// "2/8"; or "auto": what the batch system says that this task is; or "auto/8": the same where the system
/// knows the task's number only. Read are SLURM_ARRAY_TASK_ID with _COUNT, _MIN, _MAX and _STEP (arrays that
/// begin at 0 or 1 and leave no task out), AWS_BATCH_JOB_ARRAY_INDEX with AWS_BATCH_JOB_ARRAY_SIZE, and
/// JOB_COMPLETION_INDEX (Kubernetes, which tells no count). InputError that names what was found when
/// nothing is set, when a number makes no sense, or when two say different things.
Shard read_shard(const std::string& text, const EnvironmentLookup& environment);

}  // namespace texmesh
