#pragma once
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "tools/cli/options/units.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace texmesh {

/// A thin layer over CLI11, whose headers cost a source file 15 s: only command_line.cpp and help_text.cpp
/// include them. Every value that an option or an argument stores into must outlive CommandLine::run.
struct CommandLineState;

inline constexpr const char* kProgramSummary =
    "texmesh compiles textured 3D scans into packages that any static web server can stream.";

/// An option or an argument of a command, for saying more about it.
class Option {
 public:
  Option(CLI::Option* option, CommandLineState& state) : option_(option), state_(&state) {}
  Option& required();
  /// What stands for the value in the help: FILE, DIR ... (default: N for integers, X, TEXT).
  Option& value_name(const std::string& name);
  /// The help tells the value that the variable has now.
  Option& shows_default();
  Option& shows_default(const std::string& text);  // of an option that a function takes
  Option& integer_in(int least, int most);
  Option& number_in(double least, double most);  // not NaN
  /// One of these words; the help lists them after its text.
  Option& one_of(const std::vector<std::string>& words);
  /// One of these words, which the help's text explains.
  Option& one_of_explained(const std::vector<std::string>& words);
  /// Words that shells offer for the value. Who takes the value checks it, and the help's text tells of them.
  Option& offers(const std::vector<std::string>& words);
  Option& separated_by(char delimiter);
  Option& excludes(const Option& other);
  /// Only --help-all shows the option.
  Option& rare();
  /// --help shows the option beneath `title`, with its names without a dot and, where there is one, `text`.
  Option& everyday(const std::string& title, const std::string& text = "");

 private:
  CLI::Option* option_;
  CommandLineState* state_;
};

/// A command, or the program itself, which holds the others.
class Command {
 public:
  Command(CLI::App* app, CommandLineState& state) : app_(app), state_(&state) {}

  /// Commands and options that are added from here on stand beneath this title in the help.
  void group(const std::string& title) { group_ = title; }
  Command add(const std::string& name, const std::string& summary);
  /// A command of the program, with its summary of command_list.h.
  Command add(const std::string& name);
  void needs_command();
  /// No help and no shell tells of the command.
  void hidden();

  Option flag(const std::string& names, bool& value, const std::string& help);
  Option flag(const std::string& names, std::function<void()> on_given, const std::string& help);
  /// T: int, std::uint64_t, double, std::string, std::optional<double>, std::vector of int or std::string.
  /// A name without dashes makes an argument.
  template <class T>
  Option option(const std::string& names, T& value, const std::string& help);
  /// Any text; `on_given` takes it.
  Option option(const std::string& names, std::function<void(const std::string&)> on_given,
                const std::string& help);
  /// An option whose value names a group `prefix` + value: its help is printed, nothing else done.
  void help_option(const std::string& name, const std::string& prefix, const std::string& help);

  /// Command lines, one a line, which the help shows before the options.
  void examples(const std::string& lines);
  /// What the help ends with: paragraphs, one a line; lines that begin with a blank stay as they are.
  void notes(const std::string& text);
  /// What shells and man know of the command and of all beneath it: form is bash, zsh or man (shell_text.h).
  std::string shell_text(const std::string& form) const;
  /// What the command does, and the exit code of the process.
  void on_run(std::function<int()> run);

 private:
  CLI::App* app_;
  CommandLineState* state_;
  std::string group_;
};

class CommandLine {
 public:
  explicit CommandLine(const std::string& what_the_program_is, const std::string& program_name = "texmesh");
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  Command program();
  /// --version prints `text`; with --verbose it prints what `more` gives behind it.
  void version(const std::string& text, const std::function<std::string()>& more);
  /// Runs the command that the user chose. Errors are printed; their exit codes are those of exit_codes.h.
  int run(int argc, char** argv);

 private:
  void add_full_help();
  int parse_and_run(int argc, char** argv);
  std::unique_ptr<CommandLineState> state_;
  std::unique_ptr<CLI::App> app_;
};

}  // namespace texmesh
