#include "tools/cli/options/shell_text.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <sstream>
#include <vector>

#include "tools/cli/options/help_text.h"

namespace texmesh {
namespace {

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

std::string roff_option(const CLI::Option& option, const HelpNotes& notes) {
  std::string left =
      option.get_positional() ? option.get_name(true, false) : in_a_row(option_words(option), ", ");
  if (!option.get_positional() && !option.get_type_name().empty()) left += " " + option.get_type_name();
  return ".TP\n.B " + roff(left) + roff(option_description(option, notes));
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

std::string note(const std::map<const CLI::App*, std::string>& notes, const CLI::App* app) {
  const auto found = notes.find(app);
  return found == notes.end() ? "" : found->second;
}

std::string roff_command(const NamedCommand& command, const HelpNotes& notes) {
  std::string out = ".SS " + roff(command.path) + roff(command.app->get_description());
  for (const CLI::Option* o : command.app->get_options()) out += roff_option(*o, notes);
  if (const std::string lines = note(notes.examples, command.app); !lines.empty())
    out += ".PP\nExamples:\n.PP\n" + roff_lines(lines);
  return out + roff_notes(note(notes.notes, command.app));
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

}  // namespace

std::string bash_completion(const CLI::App& program, const HelpNotes& notes) {
  const std::vector<NamedCommand> commands = commands_beneath(program, program.get_name());
  std::string cases;
  for (const NamedCommand& c : commands) {
    Words names, words;
    for (const CLI::Option* o : c.app->get_options())
      for (const std::string& name : option_words(*o)) names.push_back(name);
    for (const DescribedWord& w : first_words(*c.app, notes)) words.push_back(w.word);
    cases += fmt::format("    (\"{}\") options=({}); words=({}) ;;\n", c.path, in_a_row(names, " "),
                         in_a_row(words, " "));
  }
  return fmt::format(kBash, command_pattern(commands), value_cases(commands, notes, "return"), cases,
                     program.get_name(), function_name(program));
}

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

std::string manual_page(const CLI::App& program, const HelpNotes& notes) {
  const std::string name = program.get_name(), text = program.get_description();
  std::string title = name;
  for (char& c : title) c = static_cast<char>(c >= 'a' && c <= 'z' ? c - 'a' + 'A' : c);
  std::string out = ".TH " + title + " 1 \"\" \"texmesh\" \"User Commands\"\n.SH NAME\n";
  out += roff(name + " - " + (text.starts_with(name + " ") ? text.substr(name.size() + 1) : text));
  out += ".SH SYNOPSIS\n.B " + name + "\n.I COMMAND\n[\\fIOPTIONS\\fR]\n.SH DESCRIPTION\n";
  out += roff_notes(note(notes.notes, &program)) + ".PP\nExamples:\n.PP\n" +
         roff_lines(note(notes.examples, &program));
  out += ".SH OPTIONS\n";
  for (const CLI::Option* o : program.get_options()) out += roff_option(*o, notes);
  out += ".SH COMMANDS\n";
  const std::vector<NamedCommand> commands = commands_beneath(program, program.get_name());
  for (auto c = commands.begin() + 1; c != commands.end(); ++c) out += roff_command(*c, notes);
  return out;
}

}  // namespace texmesh
