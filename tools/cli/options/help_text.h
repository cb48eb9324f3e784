#pragma once
#include <map>
#include <set>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace texmesh {

/// Where the short help shows an option, and with which text ("" = its own).
struct Everyday {
  std::string title, text;
};

/// What the help knows beyond CLI11's own descriptions.
struct HelpNotes {
  std::set<const CLI::Option*> rare;                             // only in the full help
  std::map<const CLI::Option*, Everyday> everyday;               // elsewhere in the short help
  std::map<const CLI::Option*, std::vector<std::string>> words;  // that alone the value may be
  std::map<const CLI::Option*, std::string> choices;             // words that the value is one of, "{a|b}"
  std::set<const CLI::Option*> with_default;                     // the default is told
  std::map<const CLI::App*, std::string> examples, notes;        // see Command
  std::string only_group;                                        // nothing but this group
};

/// What the option does, the words that its value is one of, its default, what it excludes.
std::string option_description(const CLI::Option& option, const HelpNotes& notes);

/// The help of a command called `name` ("texmesh compile"), wrapped to the terminal's width (60 to 100
/// columns; COLUMNS, where set, instead of the terminal's; 100 where there is none).
std::string help_text(const CLI::App& app, const std::string& name, bool full, const HelpNotes& notes);

}  // namespace texmesh
