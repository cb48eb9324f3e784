#pragma once

#include "pipeline/batch/memo/memo_segment.h"
#include "pipeline/batch/run.h"

namespace texmesh {

/// The memos of the packages of one output folder (or of one single package): a folder of segments in the
/// cache folder. Each run appends to a segment of its own, and every run reads all of them, so runs on
/// several machines need no lock and wait for nothing. Of two memos of a package the later one counts.
/// Losing any of it costs looking models over again in their child processes, never a wrong result. Not
/// thread-safe.
///
/// In memory: 56 bytes a memo that was read. Written: what has changed; a run that has written something
/// also merges segments of about the same size once there are many, so that a memo is copied a few times in
/// its life.
class BuildMemo {
 public:
  /// `outputs`: absolute path of the output folder, or of the package where a run makes one only. Without a
  /// cache folder nothing is remembered.
  BuildMemo(const std::string& cache_folder, const std::string& outputs);
  /// Saves what is left to save, and merges.
  ~BuildMemo();
  BuildMemo(const BuildMemo&) = delete;
  BuildMemo& operator=(const BuildMemo&) = delete;

  /// Some segment has bytes without their digest: what they said is not remembered.
  bool was_damaged() const;
  /// `package`: its path within the output folder. Finds what had been saved when this object was made.
  /// The memo's keys are left out.
  bool find(const std::string& package, PackageMemo& memo) const;
  /// The keys of the memo that find() finds.
  StageKeys keys(const std::string& package) const;
  void set(const std::string& package, const PackageMemo& memo);
  /// Others can read from now on what was set. False when it cannot be written.
  bool save();

 private:
  struct Place {
    MemoEntry entry;
    std::uint32_t segment = 0;
  };
  bool read_all();
  void keep_latest();
  const Place* place_of(const std::string& package) const;
  std::vector<std::uint32_t> segments_to_merge() const;
  void merge();

  std::string folder_;
  std::vector<std::unique_ptr<MemoSegment>> segments_;
  std::vector<Place> places_;  // by name, each once
  std::unique_ptr<MemoSegmentWriter> writer_;
  bool wrote_ = false;
};

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
  /// Models that need not run and failed in an earlier run.
  std::size_t recalled_failures() const { return recalled_failures_; }

  void remember(std::size_t job, const WorkerReport& report);
  /// What the model took when its stages ran, for the report of a job that found most of them in the cache.
  void tell_earlier_cost(std::size_t job, WorkerReport& report) const;
  bool memo_was_damaged() const { return memo_.was_damaged(); }
  /// False when the memo cannot be written.
  bool save_memo() { return memo_.save(); }

 private:
  /// Folders within which links of the model are followed, beside its own.
  std::vector<std::string> links_of(const PlannedModel& model) const;
  const Sha256& request_of(const PlannedModel& model);
  void recall(const PackageMemo& memo, WorkerReport& report);
  void add_job(std::size_t i, bool remembered);

  const BatchPlan& plan_;
  const RunSettings& settings_;
  BuildMemo memo_;
  std::map<std::size_t, PackageMemo> memos_;  // of an earlier run, for the models that run again
  std::vector<WorkerJob> jobs_;
  std::vector<std::size_t> model_of_job_;
  std::map<std::pair<const std::string*, std::vector<std::string>>, Sha256> requests_;
  std::string tool_seed_;
  std::size_t recalled_failures_ = 0;
};

}  // namespace texmesh
