// The JSON Schemas of what texmesh reads and prints. Each is made of the description that also reads and
// writes the document; schemas/NAME.schema.json in the sources hold the same texts.

#include "pipeline/compile/profile.h"
#include "pipeline/io/record.h"
#include "tools/cli/commands.h"
#include "tools/cli/options/command_line.h"
#include "tools/extract/extract.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/diff/diff.h"
#include "tools/inspect/verify/verify.h"
#include "tools/publish/export/export.h"
#include "tools/publish/report/report.h"
#include "tools/publish/site/site.h"

namespace texmesh {
namespace {

struct PrintedSchema {
  const char* name;
  std::string (*text)();
};
constexpr PrintedSchema kPrintedSchemas[] = {{"diff.v1", [] { return diff_schema().text; }},
                                             {"doctor.v1", [] { return doctor_schema().text; }},
                                             {"export.v1", [] { return export_schema().text; }},
                                             {"extract.v1", [] { return extract_schema().text; }},
                                             {"profile.v1", profile_schema},
                                             {"report.v1", [] { return report_schema().text; }},
                                             {"site.v1", [] { return site_schema().text; }},
                                             {"verify.v1", [] { return verify_schema().text; }}};

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
