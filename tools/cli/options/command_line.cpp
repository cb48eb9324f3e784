#include "tools/cli/options/command_line.h"

#include <CLI/CLI.hpp>
#include <algorithm>
#include <iterator>
#include <optional>
#include <stdexcept>

#include "pipeline/io/exit_codes.h"
#include "tools/cli/options/command_list.h"
#include "tools/cli/options/help_text.h"
#include "tools/cli/options/shell_text.h"
#include "tools/cli/options/told_errors.h"

namespace texmesh {

struct CommandLineState {
  HelpNotes help;
  int exit_code = kExitOk;
};

namespace {

template <class T>
const char* default_value_name() {
  if constexpr (std::is_same_v<T, std::vector<int>>)
    return "N,N...";
  else if constexpr (std::is_integral_v<T>)
    return "N";
  else if constexpr (std::is_same_v<T, double> || std::is_same_v<T, std::optional<double>>)
    return "X";
  else
    return "TEXT";
}

std::string in_braces(const std::vector<std::string>& words) {
  std::string text;
  for (const std::string& word : words) text += (text.empty() ? "{" : "|") + word;
  return text + "}";
}

}  // namespace

Option& Option::required() {
  option_->required();
  return *this;
}

Option& Option::value_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Option& Option::shows_default() {
  option_->capture_default_str();
  state_->help.with_default.insert(option_);
  return *this;
}

Option& Option::shows_default(const std::string& text) {
  option_->default_str(text);
  state_->help.with_default.insert(option_);
  return *this;
}

Option& Option::integer_in(int least, int most) {
  option_->check(CLI::Range(least, most).description(""));
  return *this;
}

Option& Option::number_in(double least, double most) {
  option_->check(NumberIn(least, most));
  return *this;
}

Option& Option::one_of(const std::vector<std::string>& words) {
  state_->help.choices[option_] = in_braces(words);
  return one_of_explained(words);
}

Option& Option::one_of_explained(const std::vector<std::string>& words) {
  option_->check(CLI::IsMember(words).description(""));
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

Command Command::add(const std::string& name, const std::string& summary) {
  CLI::App* command = app_->add_subcommand(name, summary);
  command->group(group_.empty() ? "Commands" : group_);
  return {command, *state_};
}

Command Command::add(const std::string& name) {
  const auto* const command = std::find_if(std::begin(kCommands), std::end(kCommands),
                                           [&](const CommandSummary& c) { return c.name == name; });
  if (command == std::end(kCommands)) throw std::logic_error("command_list.h does not have " + name);
  return add(name, command->text);
}

void Command::needs_command() { app_->require_subcommand(1); }

void Command::hidden() { app_->group(""); }

std::string Command::shell_text(const std::string& form) const {
  return form == "bash"  ? bash_completion(*app_, state_->help)
         : form == "zsh" ? zsh_completion(*app_, state_->help)
                         : manual_page(*app_, state_->help);
}

Option Command::flag(const std::string& names, bool& value, const std::string& help) {
  CLI::Option* option = app_->add_flag(names, value, help);
  if (!group_.empty()) option->group(group_);
  return {option, *state_};
}

Option Command::flag(const std::string& names, std::function<void()> on_given, const std::string& help) {
  CLI::Option* option = app_->add_flag_callback(names, std::move(on_given), help);
  if (!group_.empty()) option->group(group_);
  return {option, *state_};
}

template <class T>
Option Command::option(const std::string& names, T& value, const std::string& help) {
  CLI::Option* option = app_->add_option(names, value, help)->type_name(default_value_name<T>());
  if (!group_.empty()) option->group(group_);
  return {option, *state_};
}
template Option Command::option(const std::string&, int&, const std::string&);
template Option Command::option(const std::string&, std::uint64_t&, const std::string&);
template Option Command::option(const std::string&, double&, const std::string&);
template Option Command::option(const std::string&, std::string&, const std::string&);
template Option Command::option(const std::string&, std::optional<double>&, const std::string&);
template Option Command::option(const std::string&, std::vector<int>&, const std::string&);
template Option Command::option(const std::string&, std::vector<std::string>&, const std::string&);

Option Command::option(const std::string& names, std::function<void(const std::string&)> on_given,
                       const std::string& help) {
  CLI::Option* option = app_->add_option_function<std::string>(names, std::move(on_given), help);
  if (!group_.empty()) option->group(group_);
  return {option->type_name("TEXT"), *state_};
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
      "With --version: print libraries whose version changes bytes and what bounds a model's process, too";
  app_->add_flag("--verbose", help);
}

/// Commands of which the short help leaves options out have a full help.
void CommandLine::add_full_help() {
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
    return app_->exit(e) == 0 ? kExitOk : kExitUsage;
  }
  return state_->exit_code;
}

int CommandLine::run(int argc, char** argv) {
  return run_telling_errors([&] { return parse_and_run(argc, argv); });
}

}  // namespace texmesh
