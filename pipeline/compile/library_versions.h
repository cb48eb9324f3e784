#pragma once
#include <map>
#include <string>

namespace texmesh {

/// Versions of the libraries whose results reach a package's bytes, by the names that the stage table uses.
const std::map<std::string, std::string>& library_versions();

/// "g++ 12.2.0": what compiled this program. Not in keys.
std::string compiler_version();

/// "0.1.0": the version of texmesh itself. Not in keys: a stage's own version constant is what counts.
std::string tool_version();

}  // namespace texmesh
