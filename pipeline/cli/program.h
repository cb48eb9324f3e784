#pragma once

namespace texmesh {

class CommandLine;

/// What `texmesh --help` and `texmesh --version` say beside the list of commands.
void describe_program(CommandLine& line);

}  // namespace texmesh
