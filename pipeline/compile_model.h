#pragma once
#include <atomic>
#include <string>

#include "pipeline/graph_run.h"
#include "pipeline/options.h"
#include "pipeline/store.h"

namespace texmesh {

struct CompileRequest {
  std::string input;      // path of the model file
  std::string output;     // path of the package; "" = compile, check, write nothing
  std::string temporary;  // sibling of output that is renamed to it; "" = a name of its own
  CompileOptions options;
  bool strict = false;  // warnings are errors
};

struct CompileOutcome {
  std::uint64_t package_bytes = 0;
  bool unchanged = false;  // the output already held these bytes and was left alone
  Notes notes;
};

/// Compiles one model in this process: reads the input and what it refers to beneath its folder, runs the
/// graph over the store, writes the package atomically. Throws InputError, FormatError, StageError or
/// Cancelled; then nothing is left under the output's name that was not there before.
CompileOutcome compile_model(const CompileRequest& request, Store& store, const RunContext& context,
                             const StageObserver& observer);

/// Runs any graph over the model `request.input`, which it is given as "source" (and what made it as
/// "provenance"), through the same store and keys as compile_model; returns the object of artefact `wanted`.
/// `stages` must outlive the call. Errors as compile_model.
Object run_stages(const CompileRequest& request, const std::vector<Stage>& stages, const std::string& wanted,
                  Store& store, const RunContext& context, const StageObserver& observer, Notes& notes);

}  // namespace texmesh
