#pragma once
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "pipeline/batch/fleet/shards.h"
#include "pipeline/batch/plan.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

/// What a summary says of one model.
struct ModelSummary {
  std::string model, output, package;  // package: the output's path within the output folder
  ModelResult result = ModelResult::kCancelled;
  bool ran = false;
  std::uint64_t bytes = 0, peak_memory_bytes = 0;
  double seconds = 0;
  int stages_ran = 0, stages_hit = 0;
  double made_s =
      0;  // what the model took when its package was made, where this run did not make it; 0 = not known
  std::uint64_t made_memory_bytes = 0;
  ModelError error;

  bool ok() const { return result == ModelResult::kOk || result == ModelResult::kUnchanged; }
  /// Seconds of the run that made the package, 0 where nobody knows.
  double cost_s() const { return made_s > 0 ? made_s : result == ModelResult::kOk ? seconds : 0; }
};

/// A summary that merging could not use, or not as it stands.
struct SummaryProblem {
  std::string file, kind, text;  // kind: half-written, foreign, double, missing
};

/// A part of a merged summary.
struct SummaryPart {
  std::string file;
  std::optional<Shard> shard;
  std::size_t models = 0;
  double seconds = 0;
};

/// A run, or several runs merged, in numbers (schemas/summary.v1.schema.json).
struct RunSummary {
  std::vector<ModelSummary> models;
  double seconds = 0;  // of a merged summary: of all runs together
  std::optional<Shard> shard;
  std::size_t models_in_collection = 0;  // of all shards
  std::string collection;                // collection_digest(); "" where the run was no shard
  std::vector<SummaryPart> parts;        // of a merged summary
  std::vector<SummaryProblem> problems;
};

struct SummaryCounts {
  std::size_t compiled = 0, unchanged = 0, failed = 0, cancelled = 0;
};
SummaryCounts count_results(const std::vector<ModelSummary>& models);

RunSummary summarize_run(const BatchPlan& plan, const std::vector<WorkerReport>& reports, double seconds);

std::string write_summary(const RunSummary& summary);

/// The same for CI systems that read JUnit's XML: a test case per model; a model that could not be compiled
/// is a failure, one that was not reached is skipped.
std::string write_junit(const RunSummary& summary);

/// Reads what write_summary() wrote. FormatError for a text that ends too early or is no JSON, InputError
/// for JSON that is no summary.
RunSummary read_summary(std::span<const std::uint8_t> bytes, const std::string& file);

/// What models took, by their packages, for balancing shards.
std::map<std::string, double> recorded_costs_s(const RunSummary& summary);

/// The exit code that a model's result stands for: kExitTryAgain where another moment, another machine or
/// wider limits may do (cancelled, time, memory, disk).
int exit_code_of(ModelResult result, const std::string& error_kind);
/// Of two exit codes the one that tells: internal error before "try again" before "failed". Who tries again
/// meets the failed models again, so nothing is lost.
int graver_exit_code(int a, int b);

}  // namespace texmesh
