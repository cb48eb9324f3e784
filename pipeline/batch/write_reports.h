#pragma once
#include <vector>

#include "pipeline/batch/plan.h"
#include "pipeline/batch/run.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

/// InputError for a report that cannot be written, or paths that a dependency file cannot hold: before
/// anything is compiled.
void check_reports(const BatchPlan& plan, const RunSettings& settings);

/// Writes the reports and the dependency file that the settings ask for, and prints the statistics.
/// One that cannot be written keeps no other from being; false when there was one, with a message on
/// the standard error.
bool write_reports(const BatchPlan& plan, const RunSettings& settings,
                   const std::vector<WorkerReport>& reports, double seconds);

}  // namespace texmesh
