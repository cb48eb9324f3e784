#include "pipeline/batch/job_selection.h"

#include <filesystem>

#include "pipeline/batch/fleet/shards.h"
#include "pipeline/io/program.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;

/// The memory of a model that was never compiled: measured on the sample scans, rounded up.
constexpr std::uint64_t kBaseMemory_bytes = 300'000'000, kMemoryPerByte = 10;

/// Failures that only another machine or another moment explains are not remembered.
bool is_lasting(const WorkerReport& r) {
  return r.result == ModelResult::kFailed &&
         (r.more->error.kind == "input" || r.more->error.kind == "format" || r.more->error.kind == "stage");
}

}  // namespace

JobSelection::JobSelection(const BatchPlan& plan, const RunSettings& settings)
    : plan_(plan),
      settings_(settings),
      memo_(settings.cache.folder, plan.outputs),
      tool_seed_(program_build()) {}

const Sha256& JobSelection::request_of(const std::shared_ptr<const std::string>& profile) {
  const auto [it, fresh] = requests_.try_emplace(profile.get());
  if (fresh) {
    Key key("compile", 1);
    key.add("tool", tool_seed_).add("profile", *profile).add("strict", settings_.strict ? "1" : "0");
    it->second = key.digest();
  }
  return it->second;
}

void JobSelection::select(std::vector<WorkerReport>& reports) {
  for (std::size_t i = 0; i < plan_.models.size(); ++i) {
    const PlannedModel& m = plan_.models[i];
    const std::string package = package_within(plan_, m);
    MemoRecord record;
    const bool remembered = memo_.find(package, record);
    bool refreshed = false;
    if (remembered && record.request == request_of(m.profile) && !(record.failed && settings_.retry_failed) &&
        still_holds(record, m.input, m.output, refreshed)) {
      if (refreshed && !settings_.dry_run) {
        record.keys = memo_.keys(package);
        memo_.set(package, record);
      }
      recall(record, reports[i]);
      continue;
    }
    if (remembered) record.keys = memo_.keys(package);
    records_[i] = std::move(record);
    add_job(i, remembered);
  }
}

void JobSelection::recall(const MemoRecord& record, WorkerReport& r) {
  has_recalled_failure_ = has_recalled_failure_ || record.failed;
  r.result = record.failed ? ModelResult::kFailed : ModelResult::kUnchanged;
  r.package_bytes = record.package_bytes;
  if (!record.failed) r.made_s = record.seconds, r.made_memory_bytes = record.peak_memory_bytes;
  if (!settings_.depfile.empty()) r.more->files = record.files;
  if (const auto& e = record.error; record.failed && e.size() == 6)
    r.more->error = {e[0], e[1], e[2], e[3], e[4], e[5]};
}

void JobSelection::add_job(std::size_t i, bool remembered) {
  const PlannedModel& m = plan_.models[i];
  MemoRecord& record = records_[i];
  WorkerJob job;
  job.input = m.input;
  job.output = m.output;
  job.profile = m.profile;
  job.cache = settings_.cache;
  job.strict = settings_.strict;
  job.explain = settings_.explain;
  job.forecast = settings_.dry_run;
  if (remembered) {
    for (FileRequest& f : record.files)
      if (f.found && f.stamp.is_settled(record.looked_at_ns)) job.known.push_back(std::move(f));
    job.earlier_keys = std::move(record.keys);
    record.files = {};  // of 100,000 models there is no room for both
    record.keys = {};
  }
  if (remembered && record.peak_memory_bytes > 0) {
    job.predicted_memory_bytes = record.peak_memory_bytes;
    job.predicted_s = record.seconds;
  } else {
    std::error_code ec;
    const auto size = fs::file_size(m.input, ec);
    const std::uint64_t bytes = ec ? 0 : size;
    job.predicted_memory_bytes = kBaseMemory_bytes + kMemoryPerByte * bytes;
    job.predicted_s = guessed_seconds(bytes);
  }
  jobs_.push_back(std::move(job));
  model_of_job_.push_back(i);
}

void JobSelection::tell_earlier_cost(std::size_t job, WorkerReport& report) const {
  const MemoRecord& earlier = records_.at(model_of_job_[job]);
  if (!report.ok() || earlier.failed || report.stages_ran >= report.stages_hit) return;
  report.made_s = earlier.seconds;
  report.made_memory_bytes = earlier.peak_memory_bytes;
}

void JobSelection::remember(std::size_t job, const WorkerReport& report) {
  const std::size_t i = model_of_job_[job];
  if (report.more->files.empty() || (!report.ok() && !is_lasting(report))) return;
  const PlannedModel& m = plan_.models[i];
  MemoRecord record;
  record.request = request_of(m.profile);
  record.failed = !report.ok();
  record.files = report.more->files;
  record.peak_memory_bytes = report.peak_memory_bytes;
  record.seconds = report.seconds;
  record.keys = report.more->keys;
  const bool known = records_[i].peak_memory_bytes > 0;
  // A run that found everything in the cache, or that failed on the way, says little about what the model
  // costs, and a failure nothing about what the stages that it did not reach would run with.
  if (known && (!report.ok() || report.stages_hit > report.stages_ran)) {
    record.peak_memory_bytes = records_[i].peak_memory_bytes;
    record.seconds = records_[i].seconds;
  }
  if (!report.ok()) record.keys.insert(jobs_[job].earlier_keys.begin(), jobs_[job].earlier_keys.end());
  if (report.ok()) {
    const auto stamp = stamp_of(m.output);
    if (!stamp) return;
    record.package_stamp = *stamp;
    record.package_digest = report.package_digest;
    record.package_bytes = report.package_bytes;
  } else {
    const ModelError& e = report.more->error;
    record.error = {e.kind, e.file, e.place, e.expected, e.found, e.message};
  }
  record.looked_at_ns = wall_clock_ns();
  memo_.set(package_within(plan_, m), record);
}

}  // namespace texmesh
