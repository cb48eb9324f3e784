#pragma once

#include <memory>

#include "pipeline/compile/options.h"
#include "pipeline/graph/graph_run.h"
#include "pipeline/io/file_stamp.h"

namespace texmesh {

struct ModelSize;  // stage_table.h

struct CompileRequest {
  std::string input;       // path of the model file
  std::string output;      // path of the package; "" = compile, check, write nothing
  std::string temporary;   // sibling of output that is renamed to it; "" = a name of its own
  CompileOptions options;  // resolved or not
  bool strict = false;     // warnings are errors
  std::vector<std::string>
      links_within;  // folders within which symbolic links are followed, beside the model's
  /// What this process may take; a model that surely needs more is refused before its meshes are read. 0 = no
  /// limit but the machine's memory.
  std::uint64_t memory_bytes = 0;
  // Digests of an earlier run, by stamp. A file whose stamp is known is not read to learn its digest.
  std::vector<FileRequest> known;
  StageKeys earlier_keys;    // of an earlier run, to explain against
  StageExplainer explainer;  // may be empty
  // Called when compiling fails, with the files that were looked at. The same files fail again.
  std::function<void(const std::vector<FileRequest>&)> files_of_failure;
  // Called when the model is imported.
  std::function<void(const ModelSize&)> size_known;
};

struct CompileOutcome {
  std::uint64_t package_bytes = 0;
  Sha256 package_digest{};
  bool unchanged = false;  // the output already held these bytes and was left alone
  Notes notes;
  std::vector<FileRequest> files;  // what the result depends on: the model (uri ""), then what it refers to
  StageKeys keys;
};

/// What compiling so many triangles takes at least, without their textures.
std::uint64_t least_memory_bytes(std::uint64_t triangles);

/// Compiles one model in this process: reads the input and what it refers to beneath its folder, runs the
/// graph over the store, writes the package atomically. Throws InputError, FormatError, StageError or
/// Cancelled; then nothing is left under the output's name that was not there before.
CompileOutcome compile_model(const CompileRequest& request, Store& store, const RunContext& context,
                             const StageObserver& observer);

/// Runs `last` and the stages before it over the model `request.input`, through the same store and keys as
/// compile_model. Errors as compile_model.
void run_towards(const CompileRequest& request, Stage last, Store& store, const RunContext& context,
                 const StageObserver& observer, const std::function<void(GraphRun&)>& use);

/// The same for one artefact of `last`.
template <class T>
std::shared_ptr<const T> run_towards(const CompileRequest& request, Stage last, Artefact<T> wanted,
                                     Store& store, const RunContext& context, const StageObserver& observer,
                                     Notes& notes) {
  std::shared_ptr<const T> result;
  run_towards(request, std::move(last), store, context, observer, [&](GraphRun& graph) {
    result = graph.run(wanted);
    notes = graph.notes();
  });
  return result;
}

/// What compile_model would do with a stage.
struct StageForecast {
  std::string stage;
  StageExplanation explanation;
};

/// What compile_model would do, by stage, without running a stage or writing anything. The input is read, and
/// parsed where the store does not remember what it refers to.
std::vector<StageForecast> forecast_model(const CompileRequest& request, Store& store,
                                          const RunContext& context);

}  // namespace texmesh
