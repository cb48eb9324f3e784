// Schemas of the documents that commands print stand in schemas/ as the program gives them.
// TEXMESH_WRITE_SCHEMAS=1 writes them.
#include <gtest/gtest.h>

#include <cstdlib>

#include "pipeline/io/record.h"
#include "tests/support/command.h"
#include "tools/cli/commands.h"

namespace texmesh::testing::document_schemas_test {

TEST(DocumentSchemas, AreThoseOfTheProgram) {
  for (const DocumentSchema& schema : command_schemas()) {
    const std::string file = std::string(TEXMESH_SOURCE_DIR "/schemas/") + schema.name + ".schema.json";
    if (std::getenv("TEXMESH_WRITE_SCHEMAS")) write_text(file, schema.text);
    EXPECT_EQ(read_text(file), schema.text) << file;
  }
}

}  // namespace texmesh::testing::document_schemas_test
