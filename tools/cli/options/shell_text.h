#pragma once
#include <string>

namespace CLI {
class App;
}  // namespace CLI

namespace texmesh {

struct HelpNotes;

// What shells and `man` know of the program, made of the same list of commands and options that parses the
// command line. Equal lists give equal text. Hidden commands are left out.

/// A script for bash: commands, options, the words that options take; files elsewhere.
std::string bash_completion(const CLI::App& program, const HelpNotes& notes);

/// The same for zsh, with what commands and options do.
std::string zsh_completion(const CLI::App& program, const HelpNotes& notes);

/// A page for `man` (roff, macros of man(7)), section 1: every command with every option.
std::string manual_page(const CLI::App& program, const HelpNotes& notes);

}  // namespace texmesh
