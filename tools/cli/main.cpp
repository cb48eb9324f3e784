// texmesh: every command, and the workers that compile starts (pipeline/compile/workers/worker_child.cpp).
#include <fcntl.h>
#include <unistd.h>

#include <csignal>

#include "format/container/layout.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/workers/worker.h"
#include "pipeline/io/program.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

namespace {

constexpr const char* kLicences =
    "licence of this program: GPL-3.0-or-later, because parts of CGAL are compiled in (skeleton, alpha wrap, "
    "triangulations).\n"
    "licence of the sources of texmesh: Apache-2.0";

/// What reaches the bytes of packages, what bounds a model's process on this machine, and the licences.
std::string version_details() {
  std::string text;
  for (const auto& [name, version] : library_versions()) text += name + " " + version + "\n";
  return text + "compiler " + compiler_version() + "\nsandbox: " + describe_sandbox(sandbox_support()) +
         "\n" + kLicences;
}

struct ListedCommand {
  const char *group, *name;
  bool rare;
  void (*add)(Command& program);
};
#define TEXMESH_COMMAND(group, name) {group, #name, false, add_##name##_command},
#define TEXMESH_RARE(group, name) {group, #name, true, add_##name##_command},
constexpr ListedCommand kCommands[] = {TEXMESH_COMMANDS(TEXMESH_COMMAND, TEXMESH_RARE)};

/// To declare the options of every command takes longer than to see that 100 models are up to date: where the
/// first word names a command, that one alone, but for `completion`, which tells of all. --version needs
/// none.
void add_commands(Command& program, const std::string& first_word) {
  const auto is_first = [&](const ListedCommand& c) { return c.name == first_word; };
  const bool one =
      first_word == "--version" || (std::ranges::any_of(kCommands, is_first) && first_word != "completion");
  for (const ListedCommand& command : kCommands) {
    if (one && !is_first(command)) continue;
    program.group(command.group, command.rare);
    command.add(program);
  }
}

/// Where one is closed, the next file to be opened would take its place, and what is printed would go into
/// it.
void open_standard_files() {
  for (const int file : {STDIN_FILENO, STDOUT_FILENO, STDERR_FILENO})
    if (::fcntl(file, F_GETFD) < 0 && ::open("/dev/null", O_RDWR) < 0) return;
}

}  // namespace
}  // namespace texmesh

int main(int argc, char** argv) {
  using namespace texmesh;
  open_standard_files();
  std::signal(SIGXFSZ, SIG_IGN);  // a limit on files (ulimit -f) is an error that can be told
  std::vector<char*> words(argv, argv + argc);
  static char help[] = "--help", version[] = "--version";
  if (argc > 1 && argv[1] == std::string("help")) words.erase(words.begin() + 1), words.push_back(help);
  if (argc > 1 && argv[1] == std::string("version")) words[1] = version;
  const std::string first_word = words.size() > 1 ? words[1] : "";
  if (argc == 2 && first_word == "worker") return worker_main();
  if (argc == 2 && first_word == "worker-origin") return worker_origin_main();
  serve_workers();

  CommandLine line("texmesh compiles textured 3D scans into packages that any static web server can stream.");
  line.version("texmesh " + tool_version() + ", package format " + std::to_string(kFormatMajor) + "." +
                   std::to_string(kFormatMinor),
               version_details);
  Command program = line.program();
  program.examples(
      "  texmesh compile scan.glb -o scan.texmesh     compile a model\n"
      "  texmesh dump scan.texmesh                    see what is in the package\n"
      "  texmesh verify scan.texmesh                  check every byte of the package\n"
      "  texmesh view scan.texmesh                    look at the package in a browser");
  program.notes("Every command explains itself: texmesh compile --help");
  add_commands(program, first_word);
  return line.run(static_cast<int>(words.size()), words.data());
}
