#pragma once
#include <functional>
#include <string>

namespace texmesh {

class CommandLine;

/// What `texmesh --help` and `texmesh --version` say beside the list of commands. `version_details` is called
/// for `--version --verbose` alone.
void describe_program(CommandLine& line, const std::function<std::string()>& version_details);

}  // namespace texmesh
