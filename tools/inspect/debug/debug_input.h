#pragma once
#include "pipeline/compile/compile_model.h"
#include "tools/inspect/debug/debug_view.h"

namespace texmesh {

/// Runs the graph over a model up to the stage whose result is shown, and no further; results of a compile
/// with the same options come from the store. Errors as compile_model.
DebugView view_input(const CompileRequest& request, DebugQuantity what, Store& store,
                     const RunContext& context, const StageObserver& observer, Notes& notes);

/// The view of a quantity that a package holds, which is fragments and atlas alone. For the other quantities
/// InputError says what to do instead.
DebugView view_package(const std::string& path, DebugQuantity what, const RunContext& context);

/// Whether `path` is a package (a .texmesh file, or a folder that unpack made) and not a model.
bool is_package(const std::string& path);

}  // namespace texmesh
