#include "tools/cli/options/help_text.h"

#include <fmt/format.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdlib>
#include <sstream>

namespace texmesh {
namespace {

constexpr std::size_t kTextColumn = 28;

std::size_t help_width() {
  constexpr int kLeast = 60, kMost = 100;
  winsize window{};
  const char* columns = std::getenv("COLUMNS");
  int width = columns != nullptr ? std::atoi(columns) : 0;
  if (width <= 0 && ::ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) == 0) width = window.ws_col;
  return static_cast<std::size_t>(std::clamp(width > 0 ? width : kMost, kLeast, kMost));
}

/// `text` after the `column` characters that its first line has already; further lines begin at `indent`.
std::string wrapped(const std::string& text, std::size_t column, std::size_t indent) {
  const std::size_t width = help_width();
  std::istringstream words(text);
  std::string out;
  bool first = true;
  for (std::string word; words >> word; first = false) {
    if (!first && column + 1 + word.size() > width) {
      out += "\n" + std::string(indent, ' ');
      column = indent;
    } else if (!first) {
      out += ' ', ++column;
    }
    out += word, column += word.size();
  }
  return out + "\n";
}

std::string two_columns(const std::string& left, const std::string& text) {
  std::string out = "  " + left;
  if (out.size() + 2 > kTextColumn) out += "\n";
  const std::size_t used = out.back() == '\n' ? 0 : out.size();
  return out + std::string(kTextColumn - used, ' ') + wrapped(text, kTextColumn, kTextColumn);
}

/// Lines that begin with a blank stay as they are.
std::string paragraphs(const std::string& text) {
  std::istringstream lines(text);
  std::string out;
  for (std::string line; std::getline(lines, line);)
    out += line.starts_with(" ") ? line + "\n" : wrapped(line, 0, 0);
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

std::string option_line(const CLI::Option& o, const Everyday* everyday, const HelpNotes& notes) {
  std::string left = option_names(o, everyday != nullptr);
  if (!o.get_positional() && o.get_type_size() != 0 && !o.get_type_name().empty())
    left += " " + o.get_type_name();
  const bool own_text = everyday == nullptr || everyday->text.empty();
  return two_columns(left, own_text ? option_description(o, notes) : everyday->text);
}

/// Groups in the order in which their first options were added.
std::string option_groups(const CLI::App& app, bool full, const HelpNotes& notes) {
  std::vector<std::string> titles;
  std::map<std::string, std::string> lines;
  for (const CLI::Option* o : app.get_options()) {
    const auto found = notes.everyday.find(o);
    const Everyday* everyday = full || found == notes.everyday.end() ? nullptr : &found->second;
    if (!full && everyday == nullptr && notes.rare.contains(o)) continue;
    const std::string title = o->get_positional()   ? "Arguments"
                              : everyday != nullptr ? everyday->title
                                                    : o->get_group();
    if (!lines.contains(title)) titles.push_back(title);
    lines[title] += option_line(*o, everyday, notes);
  }
  std::string out;
  for (const char* first : {"Arguments", "Options"})
    if (lines.contains(first)) out += fmt::format("\n{}:\n{}", first, lines[first]);
  for (const std::string& title : titles)
    if (title != "Arguments" && title != "Options") out += fmt::format("\n{}:\n{}", title, lines[title]);
  return out;
}

std::string command_groups(const CLI::App& app) {
  std::vector<std::string> titles;
  std::map<std::string, std::string> lines;
  for (const CLI::App* command : app.get_subcommands(std::function<bool(const CLI::App*)>())) {
    const std::string& title = command->get_group();
    if (title.empty()) continue;  // hidden
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
  return wrapped(line, 0, 4);
}

std::string note_of(const std::map<const CLI::App*, std::string>& notes, const CLI::App& app) {
  const auto it = notes.find(&app);
  return it == notes.end() ? "" : it->second;
}

std::string group_alone(const CLI::App& app, const std::string& name, const HelpNotes& notes) {
  std::string out = fmt::format("{}, {}:\n", name, notes.only_group);
  for (const CLI::Option* o : app.get_options())
    if (o->get_group() == notes.only_group) out += option_line(*o, nullptr, notes);
  return out;
}

}  // namespace

std::string option_description(const CLI::Option& o, const HelpNotes& notes) {
  std::string text = o.get_description();
  if (const auto it = notes.choices.find(&o); it != notes.choices.end()) text += " " + it->second;
  if (notes.with_default.contains(&o)) text += " (default " + o.get_default_str() + ")";
  for (const CLI::Option* other : o.get_excludes()) text += " (not with " + option_names(*other, false) + ")";
  return text;
}

std::string help_text(const CLI::App& app, const std::string& name, bool full, const HelpNotes& notes) {
  if (!notes.only_group.empty()) return group_alone(app, name, notes);
  std::string out = wrapped(app.get_description(), 0, 0) + usage(app, name);
  if (const std::string lines = note_of(notes.examples, app); !lines.empty())
    out += "\nExamples:\n" + paragraphs(lines);
  out += command_groups(app) + option_groups(app, full, notes);
  if (const std::string text = note_of(notes.notes, app); !text.empty()) out += "\n" + paragraphs(text);
  return out;
}

}  // namespace texmesh
