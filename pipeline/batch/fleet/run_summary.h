#pragma once
#include <cstddef>

#include "pipeline/batch/plan.h"
#include "pipeline/compile/workers/worker.h"

namespace texmesh {

/// A test case of a report; texts may hold anything.
struct JunitCase {
  std::string class_name, name;
  std::optional<double> seconds;
  std::vector<std::pair<std::string, std::string>> properties;
  std::string failure, failure_type;  // the case failed where there is a text
  std::string skipped;                // it was not reached where there is one
  std::string output = {};            // what it said; "" = nothing
};

struct JunitSuite {
  std::string name;
  std::size_t tests = 0, failures = 0, skipped = 0;
  std::optional<double> seconds;
};

/// Results for CI systems that read JUnit's XML.
class JunitReport {
 public:
  explicit JunitReport(const JunitSuite& suite);
  void add(const JunitCase& one);
  /// The report, which is empty afterwards.
  std::string finish();

 private:
  std::string text_;
};

/// What the model took when its package was made.
struct EarlierCost {
  double seconds = 0;
  std::uint64_t peak_memory_bytes = 0;
  static void fields(auto& s, auto&& v) {
    v("seconds", s.seconds, kSeconds, "");
    v("peak_memory_bytes", s.peak_memory_bytes, "");
  }
};

/// What a summary says of one model.
struct ModelSummary : ModelNumbers {
  std::string model, output, package;  // package: the output's path within the output folder
  std::optional<EarlierCost> made;     // where this run did not make it, and it is known
  ModelError error;                    // of empty texts when nothing went wrong
  Notes warnings;                      // of this run or of the run that made the package

  /// Seconds of the run that made the package, 0 where nobody knows.
  double cost_s() const { return made ? made->seconds : result == ModelResult::kOk ? seconds : 0; }
  static void fields(auto& s, auto&& v) {
    v("model", s.model, "as the run names the model");
    v("output", s.output, "");
    v("package", s.package, "path of the output within the output folder");
    ModelNumbers::fields(s, v);
    v("made", s.made, "what the model took when its package was made, where this run did not make it");
    v("error", s.error, kMayMiss, "");
    v("warnings", s.warnings, kMayMiss,
      "warnings and what the package lacks, also of a model that is up to date; the first 20");
  }
};

/// "missing-texture at mesh.mtl:3: scan.jpg is not there".
std::string note_sentence(const Note& note);

/// A summary that merging could not use, or not as it stands.
struct SummaryProblem {
  std::string file, kind, text;
  static void fields(auto& s, auto&& v) {
    v("file", s.file, "empty where shards are missing");
    v("kind", s.kind, FieldRule{.words = "half-written|foreign|double|missing"}, "");
    v("text", s.text, "");
  }
};

/// A part of a merged summary.
struct SummaryPart {
  std::string file;
  std::optional<Shard> shard;
  std::size_t models = 0;
  double seconds = 0;
  static void fields(auto& s, auto&& v) {
    v("file", s.file, "");
    v("models", s.models, "");
    v("seconds", s.seconds, Range{0, 1e12}, "");
    v("shard", s.shard, "the part of the collection that the run compiled");
  }
};

struct SummaryCounts {
  std::size_t compiled = 0, unchanged = 0, failed = 0, cancelled = 0;
  static void fields(auto& s, auto&& v) {
    v("compiled", s.compiled, "");
    v("unchanged", s.unchanged, "");
    v("failed", s.failed, "");
    v("cancelled", s.cancelled, "");
  }
};

/// A run, or several runs merged, in numbers (schemas/summary.v1.schema.json).
struct RunSummary {
  SummaryCounts counts;  // of the models' results
  std::vector<ModelSummary> models;
  double seconds = 0;  // of a merged summary: of all runs together
  std::optional<Shard> shard;
  std::size_t models_in_collection = 0;  // of all shards; 0 where the run was no shard
  std::string collection;                // collection_digest(); "" where the run was no shard
  std::vector<SummaryPart> parts;        // of a merged summary
  std::vector<SummaryProblem> problems;
  static void fields(auto& s, auto&& v) {
    v("version", Constant{1}, "");
    SummaryCounts::fields(s.counts, v);
    v("seconds", s.seconds, Range{0, 1e12}, "of a merged summary: of all its runs together");
    v("shard", s.shard, "the part of the collection that the run compiled");
    v("models_in_collection", s.models_in_collection, kMayMiss,
      "of all shards; one of several counts the .json files of folders that it did not open, too");
    v("collection", s.collection, FieldRule{.pattern = "^[0-9a-f]{64}$", .may_miss = true},
      "SHA-256 over the names and costs of all models: runs with equal digests split the same collection alike");
    v("parts", s.parts, kMayMiss, "the summaries that were merged");
    v("problems", s.problems, kMayMiss, "what could not be merged, or not as it stands");
    v("models", s.models, "");
  }
};

SummaryCounts count_results(const std::vector<ModelSummary>& models);

RunSummary summarize_run(const BatchPlan& plan, const std::vector<WorkerReport>& reports, double seconds);

std::string write_summary(const RunSummary& summary);

/// The same for CI systems: a test case per model; a model that could not be compiled is a failure, one that
/// was not reached is skipped.
std::string write_junit(const RunSummary& summary);

/// Reads what write_summary() wrote. FormatError for a text that ends too early or is no JSON, InputError
/// for JSON that is no summary.
RunSummary read_summary(ByteSpan bytes, const std::string& file);

/// summary.v1.
DocumentSchema summary_schema();

/// What models took, by their packages, for balancing shards.
std::map<std::string, double> recorded_costs_s(const RunSummary& summary);

/// A summary's file as it was found.
struct SummaryFile {
  std::string file;
  std::optional<RunSummary> summary;  // nothing: `kind` and `text` say why
  std::string kind, text;             // half-written or foreign
};

/// Reads a summary; what cannot be used says so, nothing throws.
SummaryFile open_summary(const std::string& file);

/// One summary of many: every package once, by package. A package in several summaries keeps its best result
/// (compiled, up to date, failed, not reached). `problems` names
///   half-written  a file that is not there, ends too early or is no JSON: its shard is to be run again
///   foreign       another document, or a shard of another collection than most of the files': not merged
///   double        a file that reports packages which an earlier file reports, too
///   missing       shards that no file reports
/// Equal files in equal order give equal bytes.
RunSummary merge_summaries(std::vector<SummaryFile> files);

/// The exit code that a model's result stands for: kExitTryAgain where another moment, another machine or
/// wider limits may do (cancelled, time, memory, disk).
int exit_code_of(ModelResult result, const std::string& error_kind);
/// Of two exit codes the one that tells: internal error before "try again" before "failed". Who tries again
/// meets the failed models again, so nothing is lost.
int graver_exit_code(int a, int b);
/// Of a merged summary: that of its models, and kExitTryAgain where something is half-written or missing,
/// kExitModelFailed where something is foreign.
int exit_code_of(const RunSummary& merged);

}  // namespace texmesh
