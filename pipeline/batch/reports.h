#pragma once
#include <string>
#include <vector>

#include "pipeline/batch/plan.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

/// Chrome's trace format (chrome://tracing, Perfetto): one process per lane of the pool, in it a thread with
/// the models and threads with their stages.
std::string write_trace(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports);

/// Runs, cache hits and seconds per stage, as a table for people.
std::string write_statistics(const std::vector<WorkerReport>& reports);

}  // namespace texmesh
