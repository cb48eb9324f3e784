// What shells and man know of texmesh: made of the list of options, so whole; read by bash, zsh and groff
// where there are any.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <regex>

#include "tests/support/command.h"

namespace texmesh::testing {
namespace {

std::string told(const std::string& form) {
  const CommandResult r = run_command({TEXMESH_BINARY, "completion", form});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  return r.output;
}

bool has_program(const std::string& name) {
  return run_command({"sh", "-c", "command -v " + name}).exit_code == 0;
}

/// What bash offers for the last of these words.
std::string offered(const std::string& words, int last) {
  const std::string script = "source <('" TEXMESH_BINARY "' completion bash); COMP_WORDS=(" + words +
                             "); COMP_CWORD=" + std::to_string(last) + "; _texmesh; echo \"${COMPREPLY[*]}\"";
  const CommandResult r = run_command({"bash", "-c", script});
  EXPECT_EQ(r.exit_code, 0) << r.errors;
  EXPECT_EQ(r.errors, "");
  return r.output.substr(0, r.output.find('\n'));
}

TEST(ShellText, BashOffersCommandsOptionsAndWords) {
  EXPECT_EQ(offered("texmesh comp", 1), "compile");
  EXPECT_EQ(offered("texmesh cache pr", 2), "prune");
  EXPECT_EQ(offered("texmesh plan --bandw", 2), "--bandwidth");
  EXPECT_EQ(offered("texmesh plan --policy gu", 3), "guard");
  EXPECT_EQ(offered("texmesh plan --policy = gu", 4), "guard");
  EXPECT_EQ(offered("texmesh compile --keep-s", 2), "--keep-source");
  EXPECT_EQ(offered("texmesh compile --ladder ''", 3), "jpeg progressive webp");
  EXPECT_EQ(offered("texmesh dump a.texmesh sc", 3), "scales");
  // Files are bash's own: -o default takes over where nothing is offered.
  EXPECT_EQ(offered("texmesh compile -o ''", 3), "");
  EXPECT_EQ(offered("texmesh verify ''", 2), "");
  EXPECT_NE(told("bash").find("complete -o default"), std::string::npos);
}

TEST(ShellText, ShellsReadTheScripts) {
  TemporaryFolder folder;
  for (const std::string shell : {"bash", "zsh"}) {
    if (!has_program(shell)) continue;
    write_text(folder / shell, told(shell));
    const CommandResult r = run_command({shell, "-n", folder / shell});
    EXPECT_EQ(r.exit_code, 0) << r.errors;
  }
  EXPECT_TRUE(told("zsh").starts_with("#compdef texmesh\n"));
}

TEST(ShellText, GroffReadsThePageWithoutAWarning) {
  if (!has_program("groff")) GTEST_SKIP() << "no groff";
  TemporaryFolder folder;
  write_text(folder / "texmesh.1", told("man"));
  const CommandResult r = run_command({"groff", "-man", "-ww", "-Tascii", "-z", folder / "texmesh.1"});
  EXPECT_EQ(r.exit_code, 0);
  EXPECT_EQ(r.errors, "");
}

TEST(ShellText, NothingOfTheHelpIsMissing) {
  const std::string program = run_command({TEXMESH_BINARY, "--help"}).output;
  const std::vector<std::string> forms{told("bash"), told("zsh"),
                                       std::regex_replace(told("man"), std::regex(R"(\\-)"), "-")};
  std::size_t options = 0;
  const std::regex command_line("\n  ([a-z]+) "), option_line("\n  (?:-[a-zA-Z],)?(--[a-z0-9_.-]+)");
  for (std::sregex_iterator c(program.begin(), program.end(), command_line), end; c != end; ++c) {
    const std::string command = (*c)[1];
    if (command == "texmesh") continue;  // an example
    std::string help = run_command({TEXMESH_BINARY, command, "--help-all"}).output;
    if (help.empty()) help = run_command({TEXMESH_BINARY, command, "--help"}).output;
    for (const std::string& form : forms) EXPECT_NE(form.find("texmesh " + command), std::string::npos);
    for (std::sregex_iterator o(help.begin(), help.end(), option_line); o != end; ++o, ++options)
      for (const std::string& form : forms) EXPECT_NE(form.find((*o)[1]), std::string::npos) << (*o)[1];
  }
  EXPECT_GT(options, 200u);
  EXPECT_EQ(program.find("completion"), std::string::npos) << "a command for packagers alone";
}

TEST(ShellText, TheVersionNamesEveryLibraryThatChangesBytes) {
  const std::string text = run_command({TEXMESH_BINARY, "--version", "--verbose"}).output;
  EXPECT_TRUE(text.starts_with(run_command({TEXMESH_BINARY, "--version"}).output));
  const auto table = nlohmann::json::parse(run_command({TEXMESH_BINARY, "stages", "--json"}).output);
  std::size_t libraries = 0;
  for (const auto& stage : table["stages"])
    for (const std::string name : stage["libraries"]) {
      ++libraries;
      EXPECT_TRUE(std::regex_search(text, std::regex("\n" + name + " [0-9]"))) << name << text;
    }
  EXPECT_GT(libraries, 5u);
  EXPECT_NE(text.find("\ncompiler "), std::string::npos);
}

}  // namespace
}  // namespace texmesh::testing
