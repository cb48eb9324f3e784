#pragma once
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "format/base/fields.h"

namespace texmesh {

/// One of the parts that a collection is split into, counted from 0.
struct Shard {
  int index = 0, count = 1;
  friend bool operator==(const Shard&, const Shard&) = default;
  template <class S, class V>
  static void fields(S& s, V&& v) {
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

/// What a model counts when shards are balanced.
struct ModelCost {
  std::string_view name;  // its package, relative to the output folder: no two are equal
  std::uint64_t cost_us = 0;
};

/// The shard of every model: the costliest first, each to the shard with the least cost so far. So no shard
/// costs more than the mean and one model. The result depends on names and costs alone, not on the models'
/// order: tasks that see the same files agree without a word to each other.
std::vector<int> balance_shards(const std::vector<ModelCost>& models, int shards);

/// Hexadecimal SHA-256 over names and costs in the order of the names. Tasks with equal digests have split
/// the same collection the same way.
std::string collection_digest(const std::vector<ModelCost>& models);

/// What a model takes that was never compiled, by the bytes of its file: measured on the sample scans,
/// rounded up.
double guessed_seconds(std::uint64_t model_bytes);

}  // namespace texmesh
