#pragma once
#include <algorithm>
#include <functional>
#include <iostream>
#include <memory>
#include <optional>

#include "format/base/fields.h"
#include "pipeline/io/exit_codes.h"
#include "tools/cli/options/units.h"

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace texmesh {

/// A thin layer over CLI11, whose headers cost a source file 15 s: only command_line.cpp includes them. Every
/// value that an option or an argument stores into must outlive CommandLine::run.
struct CommandLineState;

/// An option or an argument of a command, for saying more about it.
class Option {
 public:
  Option(CLI::Option* option, CommandLineState& state) : option_(option), state_(&state) {}
  Option& required();
  /// The help tells the value that the variable has now, or `text` instead.
  Option& shows_default(const std::string& text = "");
  Option& integer_in(int least, int most);
  Option& number_in(double least, double most);  // not NaN
  /// One of these words; the help lists them after its text.
  Option& one_of(const std::vector<std::string>& words);
  /// One of these words, which the help's text explains.
  Option& one_of_explained(const std::vector<std::string>& words);
  /// The help lists the words after its text.
  Option& lists_words();
  /// Words that shells offer for the value. Who takes the value checks it, and the help's text tells of them.
  Option& offers(const std::vector<std::string>& words);
  Option& separated_by(char delimiter);
  Option& excludes(const Option& other);
  /// Only --help-all shows the option.
  Option& rare();
  /// --help shows the option beneath `title`, with its names without a dot and, where there is one, `text`.
  Option& everyday(const std::string& title, const std::string& text = "");

 private:
  friend class Command;
  Option& remembers_default(const std::string& text);
  CLI::Option* option_;
  CommandLineState* state_;
};

/// A command, or the program itself, which holds the others.
class Command {
 public:
  Command(CLI::App* app, CommandLineState& state) : app_(app), state_(&state) {}

  /// Commands and options that are added from here on stand beneath this title in the help; of `rare`
  /// commands only --help-all tells.
  void group(const std::string& title, bool rare = false);
  Command add(const std::string& name, const std::string& summary);
  /// The same with its arguments, which live as long as the program; `run` takes them and gives the exit
  /// code.
  template <class Arguments>
  std::pair<Command, std::remove_const_t<Arguments>&> add(const std::string& name, const std::string& summary,
                                                          int (*run)(Arguments&)) {
    auto args = std::make_shared<std::remove_const_t<Arguments>>();
    Command command = add(name, summary);
    command.on_run([args, run] { return run(*args); });
    return {command, *args};
  }
  void needs_command();
  /// No help and no shell tells of the command.
  void hidden();

  Option flag(const std::string& names, bool& value, const std::string& help);
  Option flag(const std::string& names, std::function<void()> on_given, const std::string& help);
  /// T: int, std::uint64_t, double, std::string, std::optional of int or double, std::vector of int or
  /// std::string.
  /// A name without dashes makes an argument. `value_name` stands for the value in the help: FILE, DIR ..
  /// (default: N for integers, X, TEXT).
  template <class T>
  Option option(const std::string& names, T& value, const std::string& help,
                const std::string& value_name = "");
  /// Any text; `on_given` takes it.
  Option option(const std::string& names, std::function<void(const std::string&)> on_given,
                const std::string& help, const std::string& value_name = "TEXT");
  /// A value that `parse` reads of text and flag: parse_bytes() and others of units.h. It throws UsageErrors.
  template <class T, class Parsed>
  Option option(const std::string& names, T& value, Parsed (*parse)(const std::string&, const std::string&),
                const std::string& help, const std::string& value_name) {
    const std::string flag = names.substr(names.find("--") == std::string::npos ? 0 : names.find("--"));
    return option(
        names, [&value, parse, flag](const std::string& text) { value = parse(text, flag); }, help,
        value_name);
  }
  /// One of the names of an enum (EnumNames), which the help's text explains.
  template <class Enum>
  Option choice(const std::string& names, Enum& value, const std::string& help,
                const std::string& value_name = "NAME") {
    return choice_of<Enum>(names, value, help, value_name).remembers_default(std::string(enum_name(value)));
  }
  /// The same where nothing is chosen by itself.
  template <class Enum>
  Option choice(const std::string& names, std::optional<Enum>& value, const std::string& help) {
    return choice_of<Enum>(names, value, help, "NAME");
  }
  /// An option that prints a text, and the program does nothing else.
  Option text_option(const std::string& name, std::string (*text)(), const std::string& help);
  /// An option whose value names a group `prefix` + value: its help is printed, nothing else done.
  void help_option(const std::string& name, const std::string& prefix, const std::string& help);

  /// Command lines, one a line, which the help shows before the options.
  void examples(const std::string& lines);
  /// What the help ends with: paragraphs, one a line; lines that begin with a blank stay as they are.
  void notes(const std::string& text);
  /// What shells and man know of the command and of all beneath it: form is bash, zsh or man.
  std::string shell_text(const std::string& form) const;
  /// What the command does, and the exit code of the process.
  void on_run(std::function<int()> run);

 private:
  Option grouped(CLI::Option* option);
  template <class Enum, class Value>
  Option choice_of(const std::string& names, Value& value, const std::string& help,
                   const std::string& value_name) {
    const std::vector<std::string> words(EnumNames<Enum>::names.begin(), EnumNames<Enum>::names.end());
    std::function<void(const std::string&)> take = [&value, words](const std::string& text) {
      value = static_cast<Enum>(std::find(words.begin(), words.end(), text) - words.begin());
    };
    return option(names, std::move(take), help, value_name).one_of_explained(words);
  }
  CLI::App* app_;
  CommandLineState* state_;
  std::string group_;
  bool rare_ = false;
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

/// Columns of a terminal, or of COLUMNS, within the bounds of a page of help.
std::size_t help_width();
/// `text` after the `column` characters that its first line has already; further lines begin at `indent`.
std::string wrapped_text(const std::string& text, std::size_t column, std::size_t indent);
/// Lines that are wider than `width` go on beneath their last column, or beneath the text of their item.
std::string wrapped_lines(const std::string& text, std::size_t width);
/// The text as standard output takes it: wrapped for a terminal, as it is for files and pipes.
std::string for_terminal(const std::string& text);

/// Runs what gives an exit code. What it throws is printed; the exit code is then that of exit_codes.h: 2 for
/// a UsageError, 1 for other errors of inputs and files, 3 for mistakes of ours.
int run_and_print_errors(const std::function<int()>& run);

}  // namespace texmesh
