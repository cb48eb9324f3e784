#pragma once
#include <functional>

namespace texmesh {

/// Runs what gives an exit code. What it throws is printed; the exit code is then that of exit_codes.h.
int run_telling_errors(const std::function<int()>& run);

}  // namespace texmesh
