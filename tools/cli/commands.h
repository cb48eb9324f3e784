#pragma once
#include <vector>

namespace texmesh {

class Command;
struct DocumentSchema;

/// The one list of commands, in the help's order: COMMAND(group of the help, name), and RARE(group, name) of
/// those that only `texmesh --help-all` lists. add_NAME_command() adds the command to the program. The
/// sources: command_compile.cpp makes packages, command_inspect.cpp looks inside (and packs),
/// command_publish.cpp exports (and views and reports), command_plan.cpp and command_fetch.cpp deliver,
/// commands_for_programs.cpp.
#define TEXMESH_COMMANDS(COMMAND, RARE)    \
  COMMAND("Make packages", compile)        \
  COMMAND("Make packages", cache)          \
  RARE("Make packages", list)              \
  RARE("Make packages", summary)           \
  COMMAND("Look inside", view)             \
  COMMAND("Look inside", dump)             \
  COMMAND("Look inside", verify)           \
  COMMAND("Look inside", diff)             \
  COMMAND("Look inside", render)           \
  COMMAND("Look inside", report)           \
  COMMAND("Look inside", doctor)           \
  COMMAND("Export", extract)               \
  COMMAND("Export", export)                \
  COMMAND("Export", site)                  \
  RARE("Export", unpack)                   \
  RARE("Export", pack)                     \
  COMMAND("Deliver over a network", plan)  \
  COMMAND("Deliver over a network", check) \
  RARE("Deliver over a network", fetch)    \
  RARE("Deliver over a network", simulate) \
  RARE("For other programs", schema)       \
  RARE("For other programs", completion)

#define TEXMESH_DECLARE(group, name) void add_##name##_command(Command& program);
TEXMESH_COMMANDS(TEXMESH_DECLARE, TEXMESH_DECLARE)
#undef TEXMESH_DECLARE

/// Of what commands print with --json, by name.
std::vector<DocumentSchema> command_schemas();

}  // namespace texmesh
