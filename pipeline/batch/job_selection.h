#pragma once
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "pipeline/batch/build_memo.h"
#include "pipeline/batch/plan.h"
#include "pipeline/batch/run.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

/// Splits a plan into models that are up to date by the memo of earlier runs and models that must run, and
/// puts into the memo what the run finds out.
class JobSelection {
 public:
  JobSelection(const BatchPlan& plan, const RunSettings& settings);

  /// Fills the reports of models that need not run.
  void select(std::vector<WorkerReport>& reports);
  const std::vector<WorkerJob>& jobs() const { return jobs_; }
  /// The job's index in the plan; it rises with the job's number.
  std::size_t model_of(std::size_t job) const { return model_of_job_[job]; }
  /// A model that need not run failed in an earlier run.
  bool has_recalled_failure() const { return has_recalled_failure_; }

  void remember(std::size_t job, const WorkerReport& report);
  /// What the model took when its stages ran, for the report of a job that found most of them in the cache.
  void tell_earlier_cost(std::size_t job, WorkerReport& report) const;
  bool memo_was_damaged() const { return memo_.was_damaged(); }
  /// False when the memo cannot be written.
  bool save_memo() { return memo_.save(); }

 private:
  const Sha256& request_of(const std::shared_ptr<const std::string>& profile);
  void recall(const MemoRecord& record, WorkerReport& report);
  void add_job(std::size_t i, bool remembered);

  const BatchPlan& plan_;
  const RunSettings& settings_;
  BuildMemo memo_;
  std::map<std::size_t, MemoRecord> records_;  // of an earlier run, for the models that run again
  std::vector<WorkerJob> jobs_;
  std::vector<std::size_t> model_of_job_;
  std::map<const std::string*, Sha256> requests_;
  std::string tool_seed_;
  bool has_recalled_failure_ = false;
};

}  // namespace texmesh
