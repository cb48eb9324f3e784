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

}  // namespace texmesh
