#pragma once

namespace texmesh {

/// Stable exit codes.
enum ExitCode : int {
  kExitOk = 0,
  kExitModelFailed = 1,
  kExitUsage = 2,
  kExitInternal = 3,
  kExitDifferent = 4
};

}  // namespace texmesh
