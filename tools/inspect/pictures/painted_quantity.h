#pragma once
#include <span>
#include <string_view>

#include "pipeline/compile/compile_model.h"
#include "pipeline/graph/stage.h"
#include "tools/inspect/pictures/painted_model.h"

namespace texmesh {

inline constexpr Artefact<PaintedModel> kPainted{"painted"};

/// The stage that paints a quantity from what it reads.
template <class... Read>
Stage painting_stage(Inputs<Read...> read, PaintedModel (*paint)(const Read&...)) {
  return make_stage({kPainted.name, 1, "what a stage computed, to look at"}, read, derived(kPainted),
                    options(), {},
                    [paint](const Read&... objects, const RunContext&) { return paint(objects...); });
}

/// Something that can be painted.
struct PaintedQuantity {
  std::string_view name;
  Stage (*stage)();
  PaintedModel (*of_package)(PackageReader&, const RunContext&);  // nullptr: a package does not hold this
};
/// atlas, fragments, scales.
std::span<const PaintedQuantity> painted_quantities();

/// Runs the graph over a model up to the stage whose result is painted, and no further; results of a compile
/// with the same options come from the store. Errors as compile_model.
PaintedModel paint_model(const CompileRequest& request, const PaintedQuantity& what, Store& store,
                         const RunContext& context, const StageObserver& observer, Notes& notes);
/// Of a package. InputError says what to do instead where a package does not hold the quantity.
PaintedModel paint_package(const std::string& path, const PaintedQuantity& what, const RunContext& context);

}  // namespace texmesh
