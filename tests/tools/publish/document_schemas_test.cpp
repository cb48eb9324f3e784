// Schemas of the documents that commands print stand in schemas/ as the program gives them.
// TEXMESH_WRITE_SCHEMAS=1 writes them.
#include <gtest/gtest.h>

#include <cstdlib>

#include "pipeline/io/record.h"
#include "tests/support/command.h"
#include "tools/cli/options/delivery_text.h"
#include "tools/extract/extract.h"
#include "tools/inspect/atlas/atlas_report.h"
#include "tools/inspect/diff/diff.h"
#include "tools/inspect/dump/dump.h"
#include "tools/inspect/verify/verify.h"
#include "tools/publish/export/export.h"
#include "tools/publish/report/report.h"
#include "tools/publish/site/site.h"

namespace texmesh::testing::document_schemas_test {

TEST(DocumentSchemas, AreThoseOfTheProgram) {
  for (const auto of_command :
       {diff_schema, doctor_schema, dump_scales_schema, export_schema, extract_schema, fetch_schema,
        plan_schema, report_schema, simulate_schema, site_schema, verify_schema}) {
    const DocumentSchema schema = of_command();
    const std::string file = std::string(TEXMESH_SOURCE_DIR "/schemas/") + schema.name + ".schema.json";
    if (std::getenv("TEXMESH_WRITE_SCHEMAS")) write_text(file, schema.text);
    EXPECT_EQ(read_text(file), schema.text) << file;
  }
}

}  // namespace texmesh::testing::document_schemas_test
