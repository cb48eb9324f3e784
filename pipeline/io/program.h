#pragma once
#include <string>

namespace texmesh {

/// Says that this program runs worker_main() where its only argument is `worker`.
void serve_workers();

/// The program to start with the argument `worker`: this one, where it said so, else `texmesh` beside it.
/// InputError when there is none.
std::string worker_executable();

/// What tells this build of the program from others: the build id that the linker has put into it, the same
/// for every copy; where there is none, size and time of the file.
std::string program_build();

}  // namespace texmesh
