#pragma once
#include <string>
#include <vector>

#include "pipeline/batch/plan.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

/// How many models ended how.
struct ResultCounts {
  std::size_t compiled = 0, unchanged = 0, failed = 0, cancelled = 0;
};
ResultCounts count_results(const std::vector<WorkerReport>& reports);

/// A run in numbers: schemas/summary.v1.schema.json.
std::string write_summary(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports,
                          double seconds);

/// The same for CI systems that read JUnit's XML: a test case per model; a model that could not be compiled
/// is a failure, one that was not reached is skipped.
std::string write_junit(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports,
                        double seconds);

/// Chrome's trace format (chrome://tracing, Perfetto): one process per lane of the pool, in it a thread with
/// the models and threads with their stages.
std::string write_trace(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports);

/// Runs, cache hits and seconds per stage, as a table for people.
std::string write_statistics(const std::vector<WorkerReport>& reports);

}  // namespace texmesh
