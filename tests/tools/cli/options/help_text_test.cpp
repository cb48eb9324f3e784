// The help pages: short enough to read, whole where they say so, every option's text in one place.
#include <gtest/gtest.h>

#include <algorithm>
#include <regex>
#include <sstream>

#include "pipeline/compile/options.h"
#include "tests/support/command.h"
#include "tools/cli/options/command_line.h"

namespace texmesh::testing::help_text_test {

constexpr std::size_t kTwoScreens = 96, kWidth = 100;

std::string help(std::vector<std::string> arguments, std::size_t width = kWidth) {
  arguments.insert(arguments.begin(), {"env", "COLUMNS=" + std::to_string(width), TEXMESH_BINARY});
  const CommandResult r = run_command(arguments);
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  return r.output;
}

std::vector<std::string> lines_of(const std::string& text) {
  std::vector<std::string> lines;
  std::istringstream in(text);
  for (std::string line; std::getline(in, line);) lines.push_back(line);
  return lines;
}

/// The lines that introduce options, and so begin with two blanks and a dash.
std::size_t times_listed(const std::string& help, const std::string& option) {
  std::size_t times = 0;
  for (const std::string& line : lines_of(help)) {
    if (!line.starts_with("  -")) continue;
    const std::string names = "," + line.substr(2, line.find(' ', 2) - 2) + ",";
    times += names.find("," + option + ",") != std::string::npos;
  }
  return times;
}

std::vector<std::string> commands(const char* help_option = "--help-all") {
  std::vector<std::string> names;
  bool in_groups = false;
  for (const std::string& line : lines_of(help({help_option}))) {
    if (line == "Make packages:") in_groups = true;
    if (line == "Options:") break;
    if (in_groups && line.starts_with("  ") && line[2] != ' ')
      names.push_back(line.substr(2, line.find(' ', 2) - 2));
  }
  return names;
}

TEST(CommandHelp, GroupsTheCommands) {
  const std::string text = help({"--help"});
  for (const char* title : {"Make packages:", "Look inside:", "Export:", "Deliver over a network:"})
    EXPECT_NE(text.find(std::string("\n") + title + "\n"), std::string::npos) << title;
}

TEST(CommandHelp, ShowsTheCommandsThatUsersNeedAndAllOnRequest) {
  EXPECT_EQ(commands("--help"),
            (std::vector<std::string>{"compile", "cache", "view", "dump", "verify", "diff", "render",
                                      "report", "doctor", "extract", "export", "site", "plan", "check"}));
  const std::vector<std::string> all = commands();
  for (const char* rare : {"list", "summary", "unpack", "pack", "fetch", "simulate"})
    EXPECT_EQ(std::ranges::count(all, rare), 1) << rare;
  EXPECT_EQ(std::ranges::count(all, "completion") + std::ranges::count(all, "schema"), 0);
}

TEST(CommandHelp, OfCompileFitsOnTwoScreens) {
  for (const std::size_t width : {kWidth, std::size_t{80}})
    EXPECT_LE(lines_of(help({"compile", "--help"}, width)).size(), kTwoScreens) << width;
}

TEST(CommandHelp, OfEveryCommandTeachesWithinTheWidth) {
  for (const std::string& command : commands()) {
    const std::string text = help({command, "--help"});
    EXPECT_NE(text.find("Usage: texmesh " + command), std::string::npos) << command;
    if (command != "cache" && command != "summary")  // these hold commands that have the examples
      EXPECT_NE(text.find("\nExamples:\n  texmesh " + command), std::string::npos) << command;
    for (const std::string& line : lines_of(text)) EXPECT_LE(line.size(), kWidth) << line;
  }
}

TEST(CommandHelp, AllOfCompileHasEveryStageOptionOnce) {
  const std::string all = help({"compile", "--help-all"}), everyday = help({"compile", "--help"});
  CompileOptions options;
  int flags = 0;
  for (const OptionField& f : list_options(options)) {
    flags += f.has_flag;
    EXPECT_EQ(times_listed(all, "--" + f.path()), f.has_flag ? 1u : 0u) << f.path();
    if (!f.has_flag) continue;
    EXPECT_EQ(times_listed(everyday, "--" + f.path()), 0u) << f.path();
    EXPECT_NE(all.find("\nStage " + f.stage + ":\n"), std::string::npos) << f.stage;
  }
  EXPECT_LE(flags, 45) << "profiles take what the method alone needs: ProfileOnly";
  for (const char* name : {"--rungs", "--ladder", "--keep-source", "--mesh-codec", "--jnd", "--title"}) {
    EXPECT_EQ(times_listed(all, name), 1u) << name;
    EXPECT_EQ(times_listed(everyday, name), 1u) << name;
  }
}

TEST(CommandHelp, OfAStageHasItsOptionsAndNoOthers) {
  const std::string text = help({"compile", "--help-stage", "ladder"});
  CompileOptions options;
  for (const OptionField& f : list_options(options))
    EXPECT_EQ(times_listed(text, "--" + f.path()), f.stage == "ladder" && f.has_flag ? 1u : 0u) << f.path();
  EXPECT_EQ(times_listed(text, "--cache"), 0u);

  const CommandResult r = run_command({TEXMESH_BINARY, "compile", "--help-stage", "lader"});
  EXPECT_EQ(r.exit_code, 2);
  EXPECT_NE(r.errors.find("ladder"), std::string::npos) << r.errors;
}

TEST(CommandHelp, RareOptionsAreInTheFullHelpAndWork) {
  EXPECT_EQ(times_listed(help({"plan", "--help"}), "--policy"), 0u);
  EXPECT_EQ(times_listed(help({"plan", "--help-all"}), "--policy"), 1u);
  const CommandResult r =
      run_command({TEXMESH_BINARY, "plan", TEXMESH_SOURCE_DIR "/tests/golden/v2.0-scan.texmesh", "--policy",
                   "thesis", "--bandwidth", "2Mbit/s"});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
}

TEST(CommandHelp, TellsOnceThatTwoOptionsExcludeEachOther) {
  const std::string text = help({"extract", "--help"}, 100);
  std::string joined = std::regex_replace(text, std::regex("\n +"), " ");
  EXPECT_EQ(joined.find("share the search (not with"), std::string::npos) << text;
  EXPECT_NE(joined.find("(not with --bytes, --scale)"), std::string::npos) << text;
  EXPECT_EQ(help({"compile", "--help"}).find("keep-going"), std::string::npos)
      << "names what it does not show";
}

TEST(WrappedLines, GoOnBeneathTheirLastColumnOrItem) {
  EXPECT_EQ(
      wrapped_lines("  charts  12  of many triangles\n- one two three four five\n  six seven eight nines\n",
                    22),
      "  charts  12  of many\n    triangles\n- one two three four\n  five\n  six seven eight\n  nines\n");
  EXPECT_EQ(wrapped_lines("  a  bb cc dd ee\n  -------  ------------\nshort\n", 12),
            "  a  bb cc\n     dd ee\n  -------  -\nshort\n");
  const std::string word(40, 'x');
  EXPECT_EQ(wrapped_lines(word + " y", 20), word + "\ny\n") << "a word is not cut";
}

}  // namespace texmesh::testing::help_text_test
