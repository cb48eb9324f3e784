#pragma once
#include <map>
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

/// Versions of the libraries whose results reach a package's bytes, by the names that the stage table uses.
const std::map<std::string, std::string>& library_versions();

/// "g++ 12.2.0": what compiled this program. Not in keys.
std::string compiler_version();

/// "0.1.0": the version of texmesh itself. Not in keys: a stage's own version constant is what counts.
std::string tool_version();

}  // namespace texmesh
