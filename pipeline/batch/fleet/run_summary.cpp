// What a run has done, model by model: written, read again, and merged from the runs of all shards.
#include "pipeline/batch/fleet/run_summary.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <set>

#include "format/base/bounded_json.h"
#include "pipeline/io/exit_codes.h"
#include "pipeline/io/file_resolver.h"
#include "pipeline/io/markup.h"

namespace texmesh {
namespace {

std::string time_attribute(const std::optional<double>& seconds) {
  return seconds ? fmt::format(" time=\"{:.3f}\"", *seconds) : "";
}

void check_shard(const std::optional<Shard>& shard, const std::string& file) {
  if (shard && shard->index >= shard->count)
    throw InputError(file, "/shard", "index below count", std::to_string(shard->index));
}

constexpr std::uint64_t kMostSummaryBytes = 1ull << 32;

/// The collection and number of shards that most files are of; of equally many the first file's.
struct Split {
  std::string collection;
  int shards = 1;
};

Split usual_split(const std::vector<SummaryFile>& files) {
  std::map<std::string, std::size_t> votes;
  for (const SummaryFile& f : files)
    if (f.summary && f.summary->shard) ++votes[f.summary->collection];
  Split split;
  std::size_t most = 0;
  for (const SummaryFile& f : files)
    if (f.summary && f.summary->shard && votes[f.summary->collection] > most) {
      most = votes[f.summary->collection];
      split = {f.summary->collection, f.summary->shard->count};
    }
  return split;
}

/// "0, 3-5"
std::string ranges_text(const std::vector<int>& numbers) {
  std::string text;
  for (std::size_t i = 0; i < numbers.size();) {
    std::size_t end = i;
    while (end + 1 < numbers.size() && numbers[end + 1] == numbers[end] + 1) ++end;
    text += (text.empty() ? "" : ", ") + std::to_string(numbers[i]);
    if (end > i) text += "-" + std::to_string(numbers[end]);
    i = end + 1;
  }
  return text;
}

class Merger {
 public:
  explicit Merger(std::vector<SummaryFile> files) : files_(std::move(files)), split_(usual_split(files_)) {}

  RunSummary merge() {
    for (SummaryFile& f : files_) {
      if (!f.summary)
        merged_.problems.push_back({f.file, f.kind, f.text});
      else if (is_foreign(*f.summary))
        merged_.problems.push_back(
            {f.file, "foreign",
             fmt::format("shard {} of {}", f.summary->shard->index, f.summary->shard->count) +
                 " of another collection, or of this one before its files changed"});
      else
        add(f.file, *f.summary);
      f.summary.reset();  // a million models stand in memory once
    }
    name_missing();
    for (auto& [package, found] : models_) merged_.models.push_back(std::move(found.model));
    merged_.counts = count_results(merged_.models);
    return std::move(merged_);
  }

 private:
  struct Found {
    ModelSummary model;
    std::string file;
  };

  bool is_foreign(const RunSummary& s) const {
    return s.shard && (s.collection != split_.collection || s.shard->count != split_.shards);
  }

  void add(const std::string& file, RunSummary& s) {
    const std::size_t models = s.models.size();
    std::map<std::string, std::size_t> doubles;  // by the file that had them first
    for (ModelSummary& m : s.models) {
      const auto [at, is_new] = models_.try_emplace(m.package);
      if (is_new)
        at->second.file = file;
      else
        ++doubles[at->second.file];
      if (is_new || m.result < at->second.model.result) at->second.model = std::move(m);
    }
    for (const auto& [other, count] : doubles)
      merged_.problems.push_back(
          {file, "double", std::to_string(count) + " of its packages are those of " + other});
    merged_.seconds += s.seconds;
    if (s.shard) seen_.insert(s.shard->index);
    if (s.parts.empty())
      merged_.parts.push_back({file, s.shard, models, s.seconds});
    else
      merged_.parts.insert(merged_.parts.end(), s.parts.begin(), s.parts.end());
  }

  void name_missing() {
    if (seen_.empty()) return;
    std::vector<int> missing;
    for (int i = 0; i < split_.shards; ++i)
      if (!seen_.contains(i)) missing.push_back(i);
    if (!missing.empty())
      merged_.problems.push_back(
          {"", "missing",
           "no summary of shards " + ranges_text(missing) + " of " + std::to_string(split_.shards)});
  }

  std::vector<SummaryFile> files_;
  Split split_;
  RunSummary merged_;
  std::map<std::string, Found> models_;  // by package
  std::set<int> seen_;
};

}  // namespace

JunitReport::JunitReport(const JunitSuite& s)
    : text_(fmt::format(
          "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuites>\n<testsuite name=\"{}\" tests=\"{}\" "
          "failures=\"{}\" errors=\"0\" skipped=\"{}\"{}>\n",
          markup_escaped(s.name), s.tests, s.failures, s.skipped, time_attribute(s.seconds))) {}

void JunitReport::add(const JunitCase& c) {
  std::string body;
  if (!c.properties.empty()) {
    body += "\n<properties>";
    for (const auto& [name, value] : c.properties)
      body += fmt::format("<property name=\"{}\" value=\"{}\"/>", name, markup_escaped(value));
    body += "</properties>\n";
  }
  if (!c.skipped.empty())
    body += fmt::format("<skipped message=\"{}\"/>\n", markup_escaped(c.skipped));
  else if (!c.failure.empty() || !c.failure_type.empty())
    body +=
        fmt::format("<failure{} message=\"{}\"/>\n",
                    c.failure_type.empty() ? "" : fmt::format(" type=\"{}\"", markup_escaped(c.failure_type)),
                    markup_escaped(c.failure));
  if (!c.output.empty()) body += "<system-out>" + markup_escaped(c.output) + "</system-out>\n";
  text_ += fmt::format("<testcase classname=\"{}\" name=\"{}\"{}", markup_escaped(c.class_name),
                       markup_escaped(c.name), time_attribute(c.seconds));
  text_ += body.empty() ? "/>\n" : ">" + body + "</testcase>\n";
}

std::string JunitReport::finish() { return std::exchange(text_, {}) + "</testsuite>\n</testsuites>\n"; }

std::string note_sentence(const Note& note) {
  return note.code + (note.place.empty() ? "" : " at " + note.place) + ": " + note.text;
}

SummaryCounts count_results(const std::vector<ModelSummary>& models) {
  SummaryCounts c;
  for (const ModelSummary& m : models)
    ++(m.result == ModelResult::kOk          ? c.compiled
       : m.result == ModelResult::kUnchanged ? c.unchanged
       : m.result == ModelResult::kCancelled ? c.cancelled
                                             : c.failed);
  return c;
}

RunSummary summarize_run(const BatchPlan& plan, const std::vector<WorkerReport>& reports, double seconds) {
  RunSummary s;
  s.seconds = seconds;
  if (plan.shard.count > 1) s.shard = plan.shard;
  s.collection = plan.collection;
  if (!s.collection.empty()) s.models_in_collection = plan.models_in_collection;
  s.models.reserve(plan.models.size());
  for (std::size_t i = 0; i < plan.models.size(); ++i) {
    const PlannedModel& m = plan.models[i];
    const WorkerReport& r = reports[i];
    std::optional<EarlierCost> made;
    if (r.made_s > 0) made = EarlierCost{r.made_s, r.made_memory_bytes};
    s.models.push_back(
        {r, std::string(m.name()), m.output, package_within(plan, m), made, r.more->error, r.more->told});
  }
  s.counts = count_results(s.models);
  return s;
}

std::string write_summary(const RunSummary& s) { return to_json_with_lines(s, "models", s.models); }

RunSummary read_summary(ByteSpan bytes, const std::string& file) {
  RunSummary s = from_json<RunSummary>(parse_bounded_json(bytes, file, 8), file);
  for (const SummaryPart& p : s.parts) check_shard(p.shard, file);
  check_shard(s.shard, file);
  return s;
}

DocumentSchema summary_schema() {
  return document_schema(
      "summary.v1", "texmesh compile summary, version 1",
      "What `texmesh compile --summary` and `texmesh summary merge` write: every model of a run, or of "
      "several, with its result.",
      schema_of<RunSummary>());
}

std::string write_junit(const RunSummary& s) {
  const SummaryCounts c = count_results(s.models);
  JunitReport report({"texmesh compile", s.models.size(), c.failed, c.cancelled, s.seconds});
  for (const ModelSummary& m : s.models) {
    JunitCase one{"texmesh",
                  m.model,
                  m.seconds,
                  {{"result", std::string(enum_name(m.result))},
                   {"output", m.output},
                   {"bytes", std::to_string(m.bytes)},
                   {"peak_memory_bytes", std::to_string(m.peak_memory_bytes)},
                   {"stages_ran", std::to_string(m.stages_ran)},
                   {"stages_from_cache", std::to_string(m.stages_hit)}},
                  {},
                  {},
                  m.result == ModelResult::kCancelled ? "not reached" : ""};
    if (!m.ok()) one.failure = m.error.message, one.failure_type = m.error.kind;
    for (const Note& n : m.warnings) one.output += note_sentence(n) + "\n";
    report.add(one);
  }
  return report.finish();
}

std::map<std::string, double> recorded_costs_s(const RunSummary& summary) {
  std::map<std::string, double> costs;
  for (const ModelSummary& m : summary.models)
    if (m.cost_s() > 0) costs[m.package] = m.cost_s();
  return costs;
}

int exit_code_of(ModelResult result, const std::string& error_kind) {
  switch (result) {
    case ModelResult::kOk:
    case ModelResult::kUnchanged:
      return kExitOk;
    case ModelResult::kCancelled:
      return kExitTryAgain;
    case ModelResult::kInternal:
      return kExitInternal;
    case ModelResult::kFailed:
      break;
  }
  return error_kind == "resource" ? kExitTryAgain : kExitModelFailed;
}

int graver_exit_code(int a, int b) {
  for (const int code : {kExitInternal, kExitTryAgain, kExitModelFailed})
    if (a == code || b == code) return code;
  return kExitOk;
}

SummaryFile open_summary(const std::string& file) {
  try {
    return {file, read_summary(read_input_file(file, kMostSummaryBytes), file), "", ""};
  } catch (const FormatError& e) {
    return {file, {}, "half-written", e.what()};
  } catch (const InputError& e) {
    // A file that is not there is as good as one that was never finished.
    const bool there = !e.expected().empty() && !e.expected().starts_with("a readable") &&
                       !e.expected().starts_with("a regular");
    return {file, {}, there ? "foreign" : "half-written", e.what()};
  }
}

RunSummary merge_summaries(std::vector<SummaryFile> files) { return Merger(std::move(files)).merge(); }

int exit_code_of(const RunSummary& merged) {
  int code = kExitOk;
  for (const ModelSummary& m : merged.models)
    code = graver_exit_code(code, exit_code_of(m.result, m.error.kind));
  for (const SummaryProblem& p : merged.problems)
    if (p.kind != "double")
      code = graver_exit_code(code, p.kind == "foreign" ? kExitModelFailed : kExitTryAgain);
  return code;
}

}  // namespace texmesh
