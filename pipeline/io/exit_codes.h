#pragma once

namespace texmesh {

/// Stable exit codes.
enum ExitCode : int {
  kExitOk = 0,
  kExitModelFailed = 1,
  kExitUsage = 2,
  kExitInternal = 3,
  kExitDifferent = 4,
  kExitTryAgain = 75  // EX_TEMPFAIL: cancelled, or time, memory or disk ran out; the models may be sound
};

}  // namespace texmesh
