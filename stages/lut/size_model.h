#pragma once

#include "format/documents/tables.h"
#include "format/documents/thesis_tables.h"
#include "stages/data/ladder.h"

namespace texmesh {

/// The size model (thesis 8.5 to 8.8) of every fragment of a plane whose sizes, qualities and order are
/// there: S = A R^Q by least squares on ln S over the rungs, Q = quality / 100, and R = (100 p)^B for the
/// fragment's VQP p. The rung of a source's coefficients never takes part: its bytes are not a quality's.
/// [F]; all 0 for fragments that are not stored, whose p is below kLeastModelVqp, or whose bytes do not grow,
/// and for fewer than two rungs. `vqp` [F] are the plane's.
std::vector<SizeModel> fit_size_models(const PlaneLadder& ladder, const PlaneTables& tables,
                                       const std::vector<float>& vqp);

}  // namespace texmesh
