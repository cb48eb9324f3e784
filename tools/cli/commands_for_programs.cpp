// Commands for other programs: the JSON Schemas of what texmesh reads and prints (each is made of the
// description that also reads and writes the document; schemas/NAME.schema.json hold the same texts), and
// what shells and man show.

#include "pipeline/batch/run.h"
#include "pipeline/io/record.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/delivery_text.h"
#include "tools/extract/extract.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/diff/diff.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/verify/verify.h"
#include "tools/publish/export/export.h"
#include "tools/publish/report/report.h"
#include "tools/publish/site/site.h"

namespace texmesh {
namespace {

std::vector<DocumentSchema> command_schemas() {
  std::vector<DocumentSchema> all = pipeline_schemas();
  for (const auto of_command :
       {diff_schema, doctor_schema, dump_scales_schema, export_schema, extract_schema, fetch_schema,
        plan_schema, report_schema, simulate_schema, site_schema, verify_schema})
    all.push_back(of_command());
  return all;
}

}  // namespace

void add_schema_command(Command& app) {
  auto name = std::make_shared<std::string>();
  Command c = app.add("schema", "Print the JSON Schema of a document that texmesh reads or prints");
  c.hidden();
  std::vector<std::string> names;
  for (const DocumentSchema& schema : command_schemas()) names.push_back(schema.name);
  c.option("NAME", *name, "The document").required().one_of(names);
  c.examples("  texmesh schema profile.v1");
  c.on_run([name] {
    for (const DocumentSchema& schema : command_schemas())
      if (*name == schema.name) std::cout << schema.text;
    return kExitOk;
  });
}

void add_completion_command(Command& app) {
  auto form = std::make_shared<std::string>();
  Command c = app.add("completion", "Print the shell completion or the manual page");
  c.hidden();
  c.option("FORM", *form, "What to print").required().one_of({"bash", "zsh", "man"});
  c.examples("  source <(texmesh completion bash)\n  texmesh completion man | man -l -");
  c.on_run([app, form] {
    std::cout << app.shell_text(*form);
    return kExitOk;
  });
}

}  // namespace texmesh
