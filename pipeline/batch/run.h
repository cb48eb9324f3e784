#pragma once

#include "pipeline/batch/plan.h"
#include "pipeline/batch/progress.h"
#include "pipeline/cache/disk_store.h"

namespace texmesh {

struct RunSettings {
  PoolSettings pool;
  CacheSettings cache;
  CacheLimits cache_limits;
  OutputMode mode = OutputMode::kPlain;
  bool verbose = false, strict = false, explain = false, dry_run = false, retry_failed = false,
       statistics = false, remove_stale = false;
  std::string depfile, summary, junit, trace;  // files to write, "" = none
  std::vector<std::string> links_within;       // CompileRequest::links_within, beside the folders of the plan
  std::vector<std::string> more_inputs;  // read for the whole run (a profile): dependencies of every package
};

/// Compiles what a plan holds and is not up to date, writes the reports that were asked for, and gives the
/// exit code of the command. A model is up to date, without a child process, when neither options nor tool
/// nor any file that it was made from nor its package has changed since the last run with this cache; one
/// that failed then is not tried again until one of them changes (`retry_failed` tries it). A cache folder
/// that cannot be made costs one warning. Packages of the plan that are stale are told at the end, or removed
/// (`remove_stale`); of several shards the first does so.
int run_batch(const BatchPlan& plan, const RunSettings& settings, std::ostream& out);

/// InputError for a report that cannot be written, or paths that a dependency file cannot hold: before
/// anything is compiled.
void check_reports(const BatchPlan& plan, const RunSettings& settings);

/// Writes the reports and the dependency file that the settings ask for, and prints the statistics.
/// One that cannot be written keeps no other from being; false when there was one, with a message on
/// the standard error.
bool write_reports(const BatchPlan& plan, const RunSettings& settings,
                   const std::vector<WorkerReport>& reports, double seconds);

/// Chrome's trace format (chrome://tracing, Perfetto): one process per lane of the pool, in it a thread with
/// the models and threads with their stages.
std::string write_trace(const std::vector<PlannedModel>& models, const std::vector<WorkerReport>& reports);

/// Runs, cache hits and seconds per stage, as a table for people.
std::string write_statistics(const std::vector<WorkerReport>& reports);

/// A dependency file that GNU make and Ninja (deps = gcc) read alike: `target: dependencies`, then an
/// empty rule per dependency, so that removing one does not stop make. Blanks, # and $ are escaped.
/// InputError for a path with a line break or a backslash before a character that is escaped, which
/// neither of them can express.
std::string write_depfile(const std::string& target, const std::vector<std::string>& dependencies);

/// The schemas of what compile, list and summary read and write: profile, JND profile, event, summary, list.
std::vector<DocumentSchema> pipeline_schemas();

}  // namespace texmesh
