#include <iostream>
#include <memory>

#include "pipeline/io/exit_codes.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {

void add_completion_command(Command& app) {
  auto form = std::make_shared<std::string>();
  Command c = app.add("completion",
                      "Print what a shell or man is to know of texmesh, as installing puts it in place");
  c.hidden();
  c.option("FORM", *form, "What to print").required().one_of({"bash", "zsh", "man"});
  c.examples("  source <(texmesh completion bash)\n  texmesh completion man | man -l -");
  c.on_run([app, form] {
    std::cout << app.shell_text(*form);
    return kExitOk;
  });
}

}  // namespace texmesh
