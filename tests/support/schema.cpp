// One source for all tests: the validator's templates took half of what a test took to compile.
#include "tests/support/schema.h"

#include <fstream>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

namespace texmesh::testing {

nlohmann::json schema_document(const std::string& name) {
  std::ifstream in(std::string(TEXMESH_SOURCE_DIR) + "/schemas/" + name + ".schema.json");
  return nlohmann::json::parse(in);
}

::testing::AssertionResult follows_schema(const nlohmann::json& document, const std::string& name) {
  const nlohmann::json text = schema_document(name);
  valijson::Schema schema;
  valijson::SchemaParser(valijson::SchemaParser::kDraft7)
      .populateSchema(valijson::adapters::NlohmannJsonAdapter(text), schema);
  valijson::ValidationResults results;
  if (valijson::Validator().validate(schema, valijson::adapters::NlohmannJsonAdapter(document), &results))
    return ::testing::AssertionSuccess();
  ::testing::AssertionResult failure = ::testing::AssertionFailure() << "not as " << name << ":";
  for (const valijson::ValidationResults::Error& error : results) {
    for (const std::string& step : error.context) failure << ' ' << step;
    failure << ": " << error.description << ';';
  }
  return failure;
}

}  // namespace texmesh::testing
