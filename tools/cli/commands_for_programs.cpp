// Commands for other programs: the JSON Schemas of what texmesh reads and prints (each is made of the
// description that also reads and writes the document; schemas/NAME.schema.json hold the same texts), and
// what shells and man show.
#include <nlohmann/json.hpp>

#include "pipeline/batch/run.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/cli/options/delivery_options.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/diff/diff.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/verify/verify.h"
#include "tools/publish/export/export.h"
#include "tools/publish/report/report.h"
#include "tools/publish/site/site.h"

namespace texmesh {

std::vector<DocumentSchema> command_schemas() {
  std::vector<DocumentSchema> all{diff_schema(),  dump_scales_schema(), extract_schema(),
                                  fetch_schema(), plan_schema(),        simulate_schema()};
  const auto add = [&]<class Record>(Record, const char* name, const char* title, const char* description) {
    all.push_back(document_schema(name, title, description, schema_of<Record>()));
  };
  add(DoctorReport{}, "doctor.v1", "texmesh atlas figures, version 1",
      "Output of `texmesh doctor INPUT --json`. `texmesh dump PKG atlas --json` has the same "
      "under \"atlas\", without input, good and reasons.");
  add(Export{}, "export.v1", "texmesh export list, version 1",
      "Output of `texmesh export PKG --to TARGET -o DIR --json`, and export.json in DIR: what was written.");
  add(Report{}, "report.v1", "texmesh report --json, version 1",
      "What a report says. FLIP is measured by rendering: 0 = equal, 1 = as different as can be.");
  add(SiteReport{}, "site.v1", "texmesh site report, version 1",
      "Output of `texmesh site PACKAGES -o DIR --json`: what the site shows.");
  add(VerifiedPackages{}, "verify.v1", "texmesh verify report, version 1",
      "Output of `texmesh verify PKG... --json`.");
  std::ranges::sort(all, {}, &DocumentSchema::name);
  return all;
}

static std::vector<DocumentSchema> all_schemas() {
  std::vector<DocumentSchema> all = pipeline_schemas();
  for (DocumentSchema& schema : command_schemas()) all.push_back(std::move(schema));
  return all;
}

void add_schema_command(Command& app) {
  auto name = std::make_shared<std::string>();
  Command c = app.add("schema", "Print the JSON Schema of a document that texmesh reads or prints");
  c.hidden();
  std::vector<std::string> names;
  for (const DocumentSchema& schema : all_schemas()) names.push_back(schema.name);
  c.option("NAME", *name, "The document").required().one_of(names);
  c.examples("  texmesh schema profile.v1");
  c.on_run([name] {
    for (const DocumentSchema& schema : all_schemas())
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
