#include "pipeline/compile/compile_model.h"

#include <filesystem>
#include <nlohmann/json.hpp>

#include "format/base/text_bytes.h"
#include "format/container/format_version.h"
#include "pipeline/compile/artefacts.h"
#include "pipeline/compile/library_versions.h"
#include "pipeline/compile/model_source.h"
#include "pipeline/compile/profile.h"
#include "pipeline/compile/stage_table.h"
#include "pipeline/io/atomic_file.h"

namespace texmesh {
namespace fs = std::filesystem;
namespace {

using Json = nlohmann::ordered_json;

/// What made the package, without dates, hosts or paths. What package.meta says stands in about.json.
std::string provenance(const ModelSource& source, const CompileOptions& options) {
  Json stages = Json::object(), libraries = Json::object();
  for (const Stage& s : default_stage_table())
    if (s.stored) stages[s.name] = s.version;
  for (const auto& [name, version] : library_versions()) libraries[name] = version;
  CompileOptions recorded = options;
  recorded.package.meta.clear();
  return Json{{"version", 1},
              {"tool", "texmesh " + tool_version()},
              {"format", {{"major", kFormatMajor}, {"minor", kFormatMinor}}},
              {"inputs", source.inputs()},
              {"options", Json::parse(write_profile(recorded))},
              {"stages", stages},
              {"libraries", libraries}}
      .dump();
}

void refuse_warnings(const Notes& notes, const std::string& input) {
  for (const Note& n : notes)
    if (n.severity == Severity::kWarning)
      throw InputError(fs::path(input).filename().string(), n.place, "no warning (--strict)",
                       n.code + ": " + n.text);
}

/// The graph over one model.
class ModelGraph {
 public:
  ModelGraph(ModelSource& source, std::vector<Stage> stages, const CompileOptions& options, Store& store,
             const RunContext& context, const StageObserver& observer)
      : stages_(std::move(stages)), graph_(stages_, store, context, observer) {
    graph_.give(kSource, source.source(), source.digest(), 0, source.parts());
    const std::string json = provenance(source, options);
    graph_.give(kProvenance, json, sha256(text_bytes(json)), json.size());
  }
  GraphRun& operator*() { return graph_; }
  GraphRun* operator->() { return &graph_; }

 private:
  std::vector<Stage> stages_;
  GraphRun graph_;  // refers to stages_, which therefore stands first
};

CompileOutcome compile_source(const CompileRequest& request, const CompileOptions& options,
                              ModelSource& source, Store& store, const RunContext& context,
                              const StageObserver& observer) {
  source.open(store, context, true);
  ModelGraph graph(source, stage_table(options), options, store, context, observer);
  graph->explain(request.earlier_keys, request.explainer);
  const std::shared_ptr<const Bytes> package = graph->run(kPackage);

  CompileOutcome outcome;
  outcome.package_bytes = package->size();
  outcome.package_digest = sha256(*package);
  outcome.notes = graph->notes();
  outcome.files = source.files();
  outcome.keys = graph->keys();
  if (request.strict) refuse_warnings(outcome.notes, request.input);
  if (request.output.empty()) return outcome;
  outcome.unchanged = file_holds(request.output, *package);
  if (!outcome.unchanged) write_output_file(request.output, *package, request.temporary);
  return outcome;
}

}  // namespace

CompileOutcome compile_model(const CompileRequest& request, Store& store, const RunContext& context,
                             const StageObserver& observer) {
  const CompileOptions options = resolve_options(request.options);
  ModelSource source(request);
  try {
    return compile_source(request, options, source, store, context, observer);
  } catch (...) {
    if (request.files_of_failure) request.files_of_failure(source.files());
    throw;
  }
}

void run_towards(const CompileRequest& request, Stage last, Store& store, const RunContext& context,
                 const StageObserver& observer, const std::function<void(GraphRun&)>& use) {
  const CompileOptions options = resolve_options(request.options);
  ModelSource source(request);
  source.open(store, context, true);
  ModelGraph graph(source, graph_towards(std::move(last), options), options, store, context, observer);
  use(*graph);
}

std::vector<StageForecast> forecast_model(const CompileRequest& request, Store& store,
                                          const RunContext& context) {
  const CompileOptions options = resolve_options(request.options);
  ModelSource source(request);
  source.open(store, context, false);
  ModelGraph graph(source, stage_table(options), options, store, context, {});
  graph->explain(request.earlier_keys, {});
  std::vector<StageForecast> forecasts;
  for (auto& [stage, explanation] : graph->forecast())
    forecasts.push_back({stage->name, std::move(explanation)});
  return forecasts;
}

}  // namespace texmesh
