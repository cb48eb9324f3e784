#pragma once
#include <iosfwd>
#include <string>
#include <vector>

#include "pipeline/batch/plan.h"
#include "pipeline/batch/progress.h"
#include "pipeline/cache/prune.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

struct RunSettings {
  PoolSettings pool;
  CacheSettings cache;
  CacheLimits cache_limits;
  OutputMode mode = OutputMode::kPlain;
  bool verbose = false, strict = false, explain = false, dry_run = false, retry_failed = false,
       statistics = false;
  std::string depfile, summary, junit, trace;  // files to write, "" = none
  std::vector<std::string> links_within;       // CompileRequest::links_within, beside the folders of the plan
  std::vector<std::string> more_inputs;  // read for the whole run (a profile): dependencies of every package
};

/// Compiles what a plan holds and is not up to date, writes the reports that were asked for, and gives the
/// exit code of the command. A model is up to date, without a child process, when neither options nor tool
/// nor any file that it was made from nor its package has changed since the last run with this cache; one
/// that failed then is not tried again until one of them changes (`retry_failed` tries it). A cache folder
/// that cannot be made costs one warning.
int run_batch(const BatchPlan& plan, const RunSettings& settings, std::ostream& out);

}  // namespace texmesh
