#pragma once
#include <functional>
#include <span>
#include <string>

namespace texmesh {

class Command;
class CommandLine;

/// What `texmesh --help` and `texmesh --version` say beside the list of commands. `version_details` is called
/// for `--version --verbose` alone.
void describe_program(CommandLine& line, const std::function<std::string()>& version_details);

/// add_compile_command() for one command line alone, its words as main() gets them: a stage's option that no
/// word names is left out, unless one asks for help. To declare all takes as long as to see that 100 models
/// are up to date.
void add_compile_command(Command& app, std::span<char* const> words);

}  // namespace texmesh
