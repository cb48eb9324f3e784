// What shells and man know of texmesh: made of the list of options, so whole; read by bash, zsh and groff
// where there are any.
#include <gtest/gtest.h>

#include <array>
#include <nlohmann/json.hpp>
#include <regex>

#include "pipeline/compile/stage_table.h"
#include "tests/support/command.h"

namespace texmesh::testing::shell_text_test {

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

/// A zsh at a terminal, to which the file's lines are typed; Tab takes the first of what is offered.
constexpr const char* kTypeToZsh = R"(zmodload zsh/zpty
zpty z env TERM=dumb zsh -f -i
zpty -w z "cd $1; PS1=; fpath=($1 \$fpath); autoload -Uz compinit; compinit -D -u; setopt menu_complete no_beep"
zpty -w z 'texmesh() { print -r -- "got <${(j:|:)@}>" }'
while IFS= read -r line; do zpty -w -n z "$line"$'\t\n'; done < $1/lines
zpty -w z exit
while zpty -r z part; do all+=$part; done
print -r -- $all)";

TEST(ShellText, ZshOffersCommandsOptionsAndWords) {
  if (!has_program("zsh")) GTEST_SKIP() << "no zsh";
  const std::vector<std::array<std::string, 2>> typed{
      {"texmesh comp", "compile"},
      {"texmesh cache pr", "cache|prune"},
      {"texmesh plan --bandw", "plan|--bandwidth"},
      {"texmesh plan --policy gu", "plan|--policy|guard"},
      {"texmesh compile --keep-s", "compile|--keep-source"},
      {"texmesh compile --ladder ", "compile|--ladder|jpeg"},
      {"texmesh compile --ladder p", "compile|--ladder|progressive"},
      {"texmesh dump a.texmesh sc", "dump|a.texmesh|scales"},
      {"texmesh compile -o a-fi", "compile|-o|a-file"},
      {"texmesh verify a-fi", "verify|a-file"},
      {"texmesh verify none", "verify|none"}};
  TemporaryFolder folder;
  write_text(folder / "_texmesh", told("zsh"));
  write_text(folder / "type", kTypeToZsh);
  write_text(folder / "a-file", "");
  std::string lines;
  for (const auto& [line, words] : typed) lines += line + "\n";
  write_text(folder / "lines", lines);
  const CommandResult r = run_command({"zsh", "-f", folder / "type", folder.path()});
  std::vector<std::string> got;
  const std::regex words("got <([a-z][^>]*)>");
  for (std::sregex_iterator w(r.output.begin(), r.output.end(), words), end; w != end; ++w)
    got.push_back((*w)[1]);
  ASSERT_EQ(got.size(), typed.size()) << r.output << r.errors;
  for (std::size_t k = 0; k < typed.size(); ++k) EXPECT_EQ(got[k], typed[k][1]) << typed[k][0];
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
  const std::string program = run_command({TEXMESH_BINARY, "--help-all"}).output;
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
  std::size_t libraries = 0;
  for (const Stage& stage : default_stage_table())
    for (const auto& library : stage.libraries) {
      ++libraries;
      EXPECT_TRUE(std::regex_search(text, std::regex("\n" + library.name + " [0-9]")))
          << library.name << text;
    }
  EXPECT_GT(libraries, 5u);
  EXPECT_NE(text.find("\ncompiler "), std::string::npos);
  EXPECT_NE(text.find("GPL-3.0-or-later"), std::string::npos);
}

}  // namespace texmesh::testing::shell_text_test
