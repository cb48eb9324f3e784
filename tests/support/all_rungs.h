#pragma once
#include "stages/ladder/ladder.h"

namespace texmesh::testing {

/// The defaults, but every rung is stored, whatever loads would choose; no previews are needed.
inline LadderOptions all_rungs() {
  LadderOptions options;
  options.prune = false;
  return options;
}

}  // namespace texmesh::testing
