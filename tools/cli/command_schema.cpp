// The JSON Schemas of what texmesh reads and prints. Each is made of the description that also reads and
// writes the document; schemas/NAME.schema.json in the sources hold the same texts.

#include "pipeline/compile/profile.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"

namespace texmesh {
namespace {

struct PrintedSchema {
  const char* name;
  std::string (*text)();
};
constexpr PrintedSchema kPrintedSchemas[] = {{"profile.v1", profile_schema}};

}  // namespace

void add_schema_command(Command& app) {
  auto name = std::make_shared<std::string>();
  Command c = app.add("schema", "Print the JSON Schema of a document that texmesh reads or prints");
  c.hidden();
  std::vector<std::string> names;
  for (const PrintedSchema& schema : kPrintedSchemas) names.emplace_back(schema.name);
  c.option("NAME", *name, "The document").required().one_of(names);
  c.examples("  texmesh schema profile.v1");
  c.on_run([name] {
    for (const PrintedSchema& schema : kPrintedSchemas)
      if (*name == schema.name) std::cout << schema.text();
    return kExitOk;
  });
}

}  // namespace texmesh
