// The command line: declared by commands through command_line.h, parsed by CLI11, told by help, by completion
// of shells and by the manual page. All of that reads the same declarations.
#include "tools/cli/options/command_line.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <map>
#include <set>
#include <sstream>

#include "pipeline/io/names/closest_word.h"

namespace texmesh {
namespace {

/// Where the short help shows an option, and with which text ("" = its own).
struct Everyday {
  std::string title, text;
};

/// What the help knows beyond CLI11's own descriptions.
struct HelpNotes {
  std::set<const CLI::Option*> rare;  // only in the full help
  std::set<const CLI::App*> rare_commands;
  std::map<const CLI::Option*, Everyday> everyday;               // elsewhere in the short help
  std::map<const CLI::Option*, std::vector<std::string>> words;  // that alone the value may be
  std::map<const CLI::Option*, std::string> choices;             // words that the value is one of, "{a|b}"
  std::set<const CLI::Option*> with_default;                     // the default is told
  std::map<const CLI::App*, std::string> examples, notes;        // see Command
  std::string only_group;                                        // nothing but this group
};

constexpr std::size_t kTextColumn = 28;

std::string two_columns(const std::string& left, const std::string& text) {
  std::string out = "  " + left;
  if (out.size() + 2 > kTextColumn) out += "\n";
  const std::size_t used = out.back() == '\n' ? 0 : out.size();
  return out + std::string(kTextColumn - used, ' ') + wrapped_text(text, kTextColumn, kTextColumn);
}

/// Lines that begin with a blank stay as they are.
std::string paragraphs(const std::string& text) {
  std::istringstream lines(text);
  std::string out;
  for (std::string line; std::getline(lines, line);)
    out += line.starts_with(" ") ? line + "\n" : wrapped_text(line, 0, 0);
  return out;
}

/// "-o,--output"; of an everyday stage option the names without its stage.
std::string option_names(const CLI::Option& o, bool short_only) {
  if (o.get_positional()) return o.get_name(true, false);
  std::string names;
  const auto add = [&](const std::string& name) { names += (names.empty() ? "" : ",") + name; };
  for (const std::string& name : o.get_snames()) add("-" + name);
  for (const std::string& name : o.get_lnames())
    if (!short_only || name.find('.') == std::string::npos) add("--" + name);
  return names;
}

/// What the option does, the words that its value is one of, its default.
std::string option_description(const CLI::Option& o, const HelpNotes& notes) {
  std::string text = o.get_description();
  if (const auto it = notes.choices.find(&o); it != notes.choices.end()) text += " " + it->second;
  if (notes.with_default.contains(&o)) text += " (default " + o.get_default_str() + ")";
  return text;
}

/// " (not with --bytes, --lods)": those of `shown` that stand before the option, so that a pair is told once.
std::string excluded(const CLI::Option& o, const std::vector<const CLI::Option*>& shown) {
  std::string names;
  for (const CLI::Option* other : shown)
    if (other == &o)
      break;
    else if (o.get_excludes().contains(const_cast<CLI::Option*>(other)))
      names += (names.empty() ? "" : ", ") + option_names(*other, false);
  return names.empty() ? "" : " (not with " + names + ")";
}

std::string option_line(const CLI::Option& o, const Everyday* everyday, const HelpNotes& notes,
                        const std::vector<const CLI::Option*>& shown = {}) {
  std::string left = option_names(o, everyday != nullptr);
  if (!o.get_positional() && o.get_type_size() != 0 && !o.get_type_name().empty())
    left += " " + o.get_type_name();
  const bool own_text = everyday == nullptr || everyday->text.empty();
  return two_columns(left, (own_text ? option_description(o, notes) : everyday->text) + excluded(o, shown));
}

/// Groups in the order in which their first options were added.
std::string option_groups(const CLI::App& app, bool full, const HelpNotes& notes) {
  std::vector<std::string> titles;
  std::map<std::string, std::string> lines;
  std::vector<const CLI::Option*> shown;
  for (const CLI::Option* o : app.get_options()) {
    const auto found = notes.everyday.find(o);
    const Everyday* everyday = full || found == notes.everyday.end() ? nullptr : &found->second;
    if (!full && everyday == nullptr && notes.rare.contains(o)) continue;
    const std::string title = o->get_positional()   ? "Arguments"
                              : everyday != nullptr ? everyday->title
                                                    : o->get_group();
    if (!lines.contains(title)) titles.push_back(title);
    lines[title] += option_line(*o, everyday, notes, shown);
    shown.push_back(o);
  }
  std::string out;
  for (const char* first : {"Arguments", "Options"})
    if (lines.contains(first)) out += fmt::format("\n{}:\n{}", first, lines[first]);
  for (const std::string& title : titles)
    if (title != "Arguments" && title != "Options") out += fmt::format("\n{}:\n{}", title, lines[title]);
  return out;
}

std::string command_groups(const CLI::App& app, bool full, const HelpNotes& notes) {
  std::vector<std::string> titles;
  std::map<std::string, std::string> lines;
  for (const CLI::App* command : app.get_subcommands(std::function<bool(const CLI::App*)>())) {
    const std::string& title = command->get_group();
    if (title.empty() || (!full && notes.rare_commands.contains(command))) continue;  // empty: hidden
    if (!lines.contains(title)) titles.push_back(title);
    lines[title] += two_columns(command->get_name(), command->get_description());
  }
  std::string out;
  for (const std::string& title : titles) out += fmt::format("\n{}:\n{}", title, lines[title]);
  return out;
}

std::string usage(const CLI::App& app, const std::string& name) {
  std::string line = "Usage: " + name;
  const bool commands = !app.get_subcommands(std::function<bool(const CLI::App*)>()).empty();
  if (commands) line += " COMMAND";
  line += " [OPTIONS]";
  for (const CLI::Option* o : app.get_options()) {
    if (!o->get_positional() && !o->get_required()) continue;
    std::string shown =
        o->get_positional() ? o->get_name(true, false) : o->get_name(false, false) + " " + o->get_type_name();
    if (o->get_positional() && o->get_expected_max() > 1) shown += "...";
    line += o->get_required() ? " " + shown : " [" + shown + "]";
  }
  return wrapped_text(line, 0, 4);
}

std::string note_of(const std::map<const CLI::App*, std::string>& notes, const CLI::App* app) {
  const auto it = notes.find(app);
  return it == notes.end() ? "" : it->second;
}

std::string group_alone(const CLI::App& app, const std::string& name, const HelpNotes& notes) {
  std::string out = fmt::format("{}, {}:\n", name, notes.only_group);
  std::vector<const CLI::Option*> shown;
  for (const CLI::Option* o : app.get_options())
    if (o->get_group() == notes.only_group) out += option_line(*o, nullptr, notes, shown), shown.push_back(o);
  return out;
}

/// The help of a command called `name` ("texmesh compile"), wrapped to the terminal's width (60 to 100
/// columns; COLUMNS, where set, instead of the terminal's; 100 where there is none).
std::string help_text(const CLI::App& app, const std::string& name, bool full, const HelpNotes& notes) {
  if (!notes.only_group.empty()) return group_alone(app, name, notes);
  std::string out = wrapped_text(app.get_description(), 0, 0) + usage(app, name);
  if (const std::string lines = note_of(notes.examples, &app); !lines.empty())
    out += "\nExamples:\n" + paragraphs(lines);
  out += command_groups(app, full, notes) + option_groups(app, full, notes);
  if (const std::string text = note_of(notes.notes, &app); !text.empty()) out += "\n" + paragraphs(text);
  return out;
}

using Words = std::vector<std::string>;

std::string in_a_row(const Words& words, const std::string& between) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "" : between) + word;
  return text;
}

/// A command with the words that lead to it, "texmesh cache stat".
struct NamedCommand {
  std::string path;
  const CLI::App* app;
};

std::vector<const CLI::App*> shown_commands(const CLI::App& app) {
  return app.get_subcommands([](const CLI::App* command) { return !command->get_group().empty(); });
}

/// The program and, depth first, all its commands.
std::vector<NamedCommand> commands_beneath(const CLI::App& app, const std::string& path) {
  std::vector<NamedCommand> commands{{path, &app}};
  for (const CLI::App* command : shown_commands(app))
    for (NamedCommand& c : commands_beneath(*command, path + " " + command->get_name()))
      commands.push_back(std::move(c));
  return commands;
}

Words option_words(const CLI::Option& option) {
  Words names;
  for (const std::string& name : option.get_snames()) names.push_back("-" + name);
  for (const std::string& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

/// The words that an option or argument takes; none where the list of options does not say.
Words words_of(const CLI::Option& option, const HelpNotes& notes) {
  const auto found = notes.words.find(&option);
  return found == notes.words.end() ? Words{} : found->second;
}

/// 'text' as bash and zsh read it.
std::string quoted(const std::string& text) {
  std::string out = "'";
  for (const char c : text) out += c == '\'' ? "'\\''" : std::string(1, c);
  return out + "'";
}

/// Patterns of a `case`: what stands before a value, "texmesh compile --ladder".
std::string patterns(const std::string& path, const CLI::Option& option) {
  Words all;
  for (const std::string& name : option_words(option)) all.push_back("\"" + path + " " + name + "\"");
  return in_a_row(all, "|");
}

/// Lines of a `case` by the command so far and the word before: the words of options that take some of these
/// alone go into `values`; after any other option that takes a value come files.
std::string value_cases(const std::vector<NamedCommand>& commands, const HelpNotes& notes,
                        const std::string& files) {
  std::string lines;
  for (const NamedCommand& c : commands)
    for (const CLI::Option* o : c.app->get_options()) {
      if (o->get_positional() || o->get_type_name().empty()) continue;  // a flag has no type
      const Words words = words_of(*o, notes);
      lines += fmt::format("    ({}) {} ;;\n", patterns(c.path, *o),
                           words.empty() ? files : "values=(" + in_a_row(words, " ") + ")");
    }
  return lines;
}

/// A pattern of all commands but the program.
std::string command_pattern(const std::vector<NamedCommand>& commands) {
  Words paths;
  for (const NamedCommand& c : commands)
    if (c.app != commands.front().app) paths.push_back("\"" + c.path + "\"");
  return in_a_row(paths, "|\\\n      ");
}

struct DescribedWord {
  std::string word, text;
};

/// What may stand in place of a command or argument: commands, or the words of the first argument.
std::vector<DescribedWord> first_words(const CLI::App& app, const HelpNotes& notes) {
  std::vector<DescribedWord> all;
  for (const CLI::App* command : shown_commands(app))
    all.push_back({command->get_name(), command->get_description()});
  for (const CLI::Option* o : app.get_options())
    if (o->get_positional() && all.empty())
      for (const std::string& word : words_of(*o, notes)) all.push_back({word, ""});
  return all;
}

std::string first_line(const std::string& text) { return text.substr(0, text.find('\n')); }

std::string described(const std::string& name, const std::string& text) {
  return quoted(name + ":" + first_line(text));
}

/// Text of roff: no character of it is a command.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) out += c == '\\' ? "\\e" : c == '-' ? "\\-" : std::string(1, c);
  std::string lines;
  std::istringstream in(out);
  for (std::string line; std::getline(in, line);)
    lines += (line.starts_with(".") || line.starts_with("'") ? "\\&" : "") + line + "\n";
  return lines;
}

std::string roff_option(const CLI::Option& option, const CLI::App& app, const HelpNotes& notes) {
  std::string left =
      option.get_positional() ? option.get_name(true, false) : in_a_row(option_words(option), ", ");
  if (!option.get_positional() && !option.get_type_name().empty()) left += " " + option.get_type_name();
  return ".TP\n.B " + roff(left) +
         roff(option_description(option, notes) + excluded(option, app.get_options()));
}

/// Lines as they are: of examples, and of notes that begin with a blank.
std::string roff_lines(const std::string& text) { return ".nf\n" + roff(text) + ".fi\n"; }

std::string roff_notes(const std::string& text) {
  std::string out;
  std::istringstream lines(text);
  for (std::string line; std::getline(lines, line);)
    out += line.starts_with(" ") ? roff_lines(line) : ".PP\n" + roff(line);
  return out;
}

std::string roff_command(const NamedCommand& command, const HelpNotes& notes) {
  std::string out = ".SS " + roff(command.path) + roff(command.app->get_description());
  for (const CLI::Option* o : command.app->get_options()) out += roff_option(*o, *command.app, notes);
  if (const std::string lines = note_of(notes.examples, command.app); !lines.empty())
    out += ".PP\nExamples:\n.PP\n" + roff_lines(lines);
  return out + roff_notes(note_of(notes.notes, command.app));
}

constexpr const char* kBash =
    R"(# bash completion for {3}, made of its list of options: {3} completion bash
{4}() {{
  local current=${{COMP_WORDS[COMP_CWORD]}} previous=${{COMP_WORDS[COMP_CWORD - 1]}} path={3} k
  local -a values=() options=() words=()
  COMPREPLY=()
  [[ $previous == = ]] && previous=${{COMP_WORDS[COMP_CWORD - 2]}}
  [[ $current == = ]] && current=
  for ((k = 1; k < COMP_CWORD; k++)); do
    case "$path ${{COMP_WORDS[k]}}" in
      ({0}) path="$path ${{COMP_WORDS[k]}}" ;;
    esac
  done
  case "$path $previous" in
{1}  esac
  case "$path" in
{2}  esac
  if ((${{#values[@]}})); then words=("${{values[@]}}")
  elif [[ $current == -* ]]; then words=("${{options[@]}}")
  fi
  COMPREPLY=($(compgen -W "${{words[*]}}" -- "$current"))
}}
complete -o default -F {4} {3}
)";

constexpr const char* kZsh = R"(#compdef {3}
# zsh completion for {3}, made of its list of options: {3} completion zsh
{4}() {{
  local at={3} k
  local -a values options commands
  for ((k = 2; k < CURRENT; k++)); do
    case "$at $words[k]" in
      ({0}) at="$at $words[k]" ;;
    esac
  done
  case "$at $words[CURRENT-1]" in
{1}  esac
  if (( $#values )); then compadd -- $values; return; fi
  case "$at" in
{2}  esac
  if [[ $words[CURRENT] == -* ]]; then _describe option options
  elif (( $#commands )); then _describe command commands
  else _files
  fi
}}
{4} "$@"
)";

/// The name of a shell's function.
std::string function_name(const CLI::App& program) {
  std::string name = "_" + program.get_name();
  std::ranges::replace(name, '-', '_');
  return name;
}

// What shells and `man` know of the program. Equal declarations give equal text. Hidden commands are left
// out.

/// A script for bash: commands, options, the words that options take; files elsewhere.
std::string bash_completion(const CLI::App& program, const HelpNotes& notes) {
  const std::vector<NamedCommand> commands = commands_beneath(program, program.get_name());
  std::string cases;
  for (const NamedCommand& c : commands) {
    Words names, words;
    for (const CLI::Option* o : c.app->get_options())
      std::ranges::copy(option_words(*o), std::back_inserter(names));
    for (const DescribedWord& w : first_words(*c.app, notes)) words.push_back(w.word);
    cases += fmt::format("    (\"{}\") options=({}); words=({}) ;;\n", c.path, in_a_row(names, " "),
                         in_a_row(words, " "));
  }
  return fmt::format(kBash, command_pattern(commands), value_cases(commands, notes, "return"), cases,
                     program.get_name(), function_name(program));
}

/// The same for zsh, with what commands and options do.
std::string zsh_completion(const CLI::App& program, const HelpNotes& notes) {
  const std::vector<NamedCommand> commands = commands_beneath(program, program.get_name());
  std::string cases;
  for (const NamedCommand& c : commands) {
    Words options, words;
    for (const CLI::Option* o : c.app->get_options())
      for (const std::string& name : option_words(*o))
        options.push_back(described(name, option_description(*o, notes)));
    for (const DescribedWord& w : first_words(*c.app, notes)) words.push_back(described(w.word, w.text));
    const std::string between = "\n        ";
    cases += fmt::format("    (\"{}\")\n      options=({})\n      commands=({})\n      ;;\n", c.path,
                         in_a_row(options, between), in_a_row(words, between));
  }
  return fmt::format(kZsh, command_pattern(commands), value_cases(commands, notes, "_files; return"), cases,
                     program.get_name(), function_name(program));
}

/// A page for `man` (roff, macros of man(7)), section 1: every command with every option.
std::string manual_page(const CLI::App& program, const HelpNotes& notes) {
  const std::string name = program.get_name(), text = program.get_description();
  std::string title = name;
  for (char& c : title) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  std::string out = ".TH " + title + " 1 \"\" \"texmesh\" \"User Commands\"\n.SH NAME\n";
  out += roff(name + " - " + (text.starts_with(name + " ") ? text.substr(name.size() + 1) : text));
  out += ".SH SYNOPSIS\n.B " + name + "\n.I COMMAND\n[\\fIOPTIONS\\fR]\n.SH DESCRIPTION\n";
  out += roff_notes(note_of(notes.notes, &program)) + ".PP\nExamples:\n.PP\n" +
         roff_lines(note_of(notes.examples, &program));
  out += ".SH OPTIONS\n";
  for (const CLI::Option* o : program.get_options()) out += roff_option(*o, program, notes);
  out += ".SH COMMANDS\n";
  const std::vector<NamedCommand> commands = commands_beneath(program, program.get_name());
  for (auto c = commands.begin() + 1; c != commands.end(); ++c) out += roff_command(*c, notes);
  return out;
}

/// What was written and belongs to no option or argument, up to a "=".
std::string first_unknown(const CLI::App& app, bool option) {
  for (const std::string& word : app.remaining())
    if (word.starts_with("-") == option) return word.substr(0, word.find('='));
  return "";
}

/// What is wrong, with what a word that means nothing here may have been meant for; "" where nothing is.
std::string refusal(const CLI::App& program, const CLI::ParseError& e) {
  if (e.get_exit_code() == 0) return "";
  const CLI::App* app = &program;
  std::string path = program.get_name();
  for (; !app->get_subcommands().empty(); path += " " + app->get_name()) app = app->get_subcommands().back();
  const std::string name = first_unknown(*app, true);
  if (e.get_name() == "RequiredError" && app->get_require_subcommand_min() > 0 && name.empty()) {
    Words names;
    for (const CLI::App* c : app->get_subcommands(std::function<bool(const CLI::App*)>()))
      if (!c->get_group().empty()) names.push_back(c->get_name());
    const std::string written = first_unknown(*app, false);
    return path +
           (written.empty() ? ": a command is missing"
                            : ": there is no command " + written + meant_instead(written, names)) +
           " (" + path + " --help lists the commands)";
  }
  if (e.get_name() != "ExtrasError" && name.empty())
    return path + ": " + e.what() + " (" + path + " --help tells more)";
  if (name.empty()) return path + ": expected no further argument, found " + first_unknown(*app, false);
  Words names;
  for (const CLI::Option* o : app->get_options())
    std::ranges::copy(option_words(*o), std::back_inserter(names));
  if (::access(name.c_str(), F_OK) == 0) return path + ": " + name + " is no option; the file is ./" + name;
  const std::string meant = meant_instead(name, names);
  return path + ": there is no option " + name + meant + " (" + path + " --help lists the options)";
}

/// A script's variable that was never set would else count as an option that was not given.
std::string empty_fault(const std::string& text) {
  return text.empty() ? "expected a value, found an empty text" : "";
}

template <class T>
const char* default_value_name() {
  if constexpr (std::is_same_v<T, std::vector<int>>)
    return "N,N...";
  else if constexpr (std::is_integral_v<T> || std::is_same_v<T, std::optional<int>>)
    return "N";
  else if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>>)
    return "X";
  else
    return "TEXT";
}

}  // namespace

struct CommandLineState {
  HelpNotes help;
  int exit_code = kExitOk;
};

Option& Option::required() {
  option_->required();
  return *this;
}

Option& Option::shows_default(const std::string& text) {
  option_->capture_default_str();
  if (!text.empty()) option_->default_str(text);
  state_->help.with_default.insert(option_);
  return *this;
}

Option& Option::integer_in(int least, int most) {
  option_->check(CLI::Range(least, most).description(""));
  return *this;
}

Option& Option::number_in(double least, double most) {
  option_->check([least, most](const std::string& text) { return number_fault(text, least, most); });
  return *this;
}

Option& Option::one_of(const std::vector<std::string>& words) {
  return one_of_explained(words).lists_words();
}

Option& Option::lists_words() {
  state_->help.choices[option_] = "{" + in_a_row(state_->help.words[option_], "|") + "}";
  return *this;
}

Option& Option::remembers_default(const std::string& text) {
  option_->default_str(text);
  return *this;
}

Option& Option::one_of_explained(const std::vector<std::string>& words) {
  option_->transform(CLI::Validator([words](std::string& w) { return choice_fault(w, words); }, ""));
  return offers(words);
}

Option& Option::offers(const std::vector<std::string>& words) {
  state_->help.words[option_] = words;
  return *this;
}

Option& Option::separated_by(char delimiter) {
  option_->delimiter(delimiter);
  return *this;
}

Option& Option::excludes(const Option& other) {
  option_->excludes(other.option_);
  return *this;
}

Option& Option::rare() {
  state_->help.rare.insert(option_);
  return *this;
}

Option& Option::everyday(const std::string& title, const std::string& text) {
  state_->help.everyday[option_] = {title, text};
  return *this;
}

void Command::group(const std::string& title, bool rare) {
  group_ = title;
  rare_ = rare;
}

Command Command::add(const std::string& name, const std::string& summary) {
  CLI::App* command = app_->add_subcommand(name, summary);
  command->group(group_.empty() ? "Commands" : group_);
  if (rare_) state_->help.rare_commands.insert(command);
  return {command, *state_};
}

void Command::needs_command() { app_->require_subcommand(1); }

void Command::hidden() { app_->group(""); }

std::string Command::shell_text(const std::string& form) const {
  return form == "bash"  ? bash_completion(*app_, state_->help)
         : form == "zsh" ? zsh_completion(*app_, state_->help)
                         : manual_page(*app_, state_->help);
}

Option Command::grouped(CLI::Option* option) {
  if (!group_.empty()) option->group(group_);
  return {option, *state_};
}

Option Command::flag(const std::string& names, bool& value, const std::string& help) {
  return grouped(app_->add_flag(names, value, help));
}

Option Command::flag(const std::string& names, std::function<void()> on_given, const std::string& help) {
  return grouped(app_->add_flag_callback(names, std::move(on_given), help));
}

template <class T>
Option Command::option(const std::string& names, T& value, const std::string& help,
                       const std::string& value_name) {
  CLI::Option* option = app_->add_option(names, value, help)->check(empty_fault);
  return grouped(option->type_name(value_name.empty() ? default_value_name<T>() : value_name));
}
template Option Command::option(const std::string&, int&, const std::string&, const std::string&);
template Option Command::option(const std::string&, std::uint64_t&, const std::string&, const std::string&);
template Option Command::option(const std::string&, double&, const std::string&, const std::string&);
template Option Command::option(const std::string&, std::string&, const std::string&, const std::string&);
template Option Command::option(const std::string&, std::optional<int>&, const std::string&,
                                const std::string&);
template Option Command::option(const std::string&, std::optional<double>&, const std::string&,
                                const std::string&);
template Option Command::option(const std::string&, std::vector<int>&, const std::string&,
                                const std::string&);
template Option Command::option(const std::string&, std::vector<std::string>&, const std::string&,
                                const std::string&);

Option Command::option(const std::string& names, std::function<void(const std::string&)> on_given,
                       const std::string& help, const std::string& value_name) {
  CLI::Option* option = app_->add_option_function<std::string>(names, std::move(on_given), help);
  return grouped(option->check(empty_fault)->type_name(value_name));
}

void Command::help_option(const std::string& name, const std::string& prefix, const std::string& help) {
  const auto print = [app = app_, state = state_, name, prefix](const std::string& value) {
    const std::string title = prefix + value;
    const std::vector<std::string> titles = app->get_groups();
    if (std::find(titles.begin(), titles.end(), title) == titles.end()) {
      std::string known;
      for (const std::string& t : titles)
        if (t.starts_with(prefix)) known += (known.empty() ? "" : ", ") + t.substr(prefix.size());
      throw CLI::ValidationError(name, "expected one of " + known + "; found " + value);
    }
    state->help.only_group = title;
    throw CLI::CallForHelp();
  };
  app_->add_option_function<std::string>(name, print, help)->type_name("NAME");
}

Option Command::text_option(const std::string& name, std::string (*text)(), const std::string& help) {
  const auto print = [text] {
    std::cout << text();
    throw CLI::Success();
  };
  return flag(name, print, help);
}

void Command::examples(const std::string& lines) { state_->help.examples[app_] = lines; }

void Command::notes(const std::string& text) { state_->help.notes[app_] = text; }

void Command::on_run(std::function<int()> run) {
  app_->callback([state = state_, run = std::move(run)] { state->exit_code = run(); });
}

CommandLine::CommandLine(const std::string& what_the_program_is, const std::string& program_name)
    : state_(std::make_unique<CommandLineState>()),
      app_(std::make_unique<CLI::App>(what_the_program_is, program_name)) {
  app_->require_subcommand(1);
  app_->set_help_flag("-h,--help", "Print this help");
  app_->formatter_fn([this](const CLI::App* app, const std::string& name, CLI::AppFormatMode mode) {
    return help_text(*app, name, mode == CLI::AppFormatMode::All, state_->help);
  });
}

CommandLine::~CommandLine() = default;

Command CommandLine::program() { return {app_.get(), *state_}; }

void CommandLine::version(const std::string& text, const std::function<std::string()>& more) {
  const auto told = [this, text, more] { return app_->count("--verbose") > 0 ? text + "\n" + more() : text; };
  app_->set_version_flag("--version", told, "Print the versions of texmesh and of its package format");
  const std::string help =
      "With --version: print libraries whose version changes bytes, what bounds a model's process, and the licence "
      "of the program, too";
  app_->add_flag("--verbose", help);
}

/// Where the short help leaves commands or options out there is a full help.
void CommandLine::add_full_help() {
  if (!state_->help.rare_commands.empty())
    app_->set_help_all_flag("--help-all", "Print this help with every command");
  for (CLI::App* command : app_->get_subcommands(std::function<bool(CLI::App*)>())) {
    const std::vector<CLI::Option*> options = command->get_options();
    const auto rare = [&](const CLI::Option* option) { return state_->help.rare.contains(option); };
    if (std::any_of(options.begin(), options.end(), rare))
      command->set_help_all_flag("--help-all", "Print every option");
  }
}

int CommandLine::parse_and_run(int argc, char** argv) {
  add_full_help();
  try {
    app_->parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    const std::string text = refusal(*app_, e);
    if (!text.empty()) return std::cerr << text << '\n', kExitUsage;
    app_->exit(e);
    return kExitOk;
  }
  return state_->exit_code;
}

int CommandLine::run(int argc, char** argv) {
  return run_and_print_errors([&] { return parse_and_run(argc, argv); });
}

}  // namespace texmesh
