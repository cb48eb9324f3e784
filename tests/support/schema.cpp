// One source for all tests: the validator's templates took half of what a test took to compile.
#include "tests/support/schema.h"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validation_results.hpp>
#include <valijson/validator.hpp>

#include "format/base/errors.h"

namespace texmesh::testing {
namespace {

namespace fs = std::filesystem;
const fs::path kRoot = TEXMESH_SOURCE_DIR;
const std::string kSuffix = ".schema.json";

std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

}  // namespace

std::vector<std::string> schema_names(const std::string& folder) {
  std::vector<std::string> names;
  for (const auto& e : fs::directory_iterator(kRoot / folder)) {
    const std::string name = e.path().filename().string();
    if (name.ends_with(kSuffix)) names.push_back(name.substr(0, name.size() - kSuffix.size()));
  }
  std::sort(names.begin(), names.end());
  return names;
}

nlohmann::json schema_document(const std::string& name) {
  const fs::path product = kRoot / "schemas" / (name + kSuffix);
  return nlohmann::json::parse(
      read_file(fs::exists(product) ? product : kRoot / "lab/schemas" / (name + kSuffix)));
}

void check_examples(const std::string& folder, const std::string& name,
                    const std::function<void(const std::string& document)>& reader) {
  const nlohmann::json document = schema_document(name);
  EXPECT_EQ(document["$schema"], "http://json-schema.org/draft-07/schema#");
  EXPECT_TRUE(document["title"].is_string());
  EXPECT_TRUE(document["description"].is_string());
  int valid = 0, invalid = 0;
  for (const auto& e : fs::directory_iterator(kRoot / folder / "examples" / name)) {
    SCOPED_TRACE(e.path().filename().string());
    const bool expected = e.path().filename().string().starts_with("valid-");
    ASSERT_TRUE(expected || e.path().filename().string().starts_with("invalid-"));
    ++(expected ? valid : invalid);
    const std::string text = read_file(e.path());
    const auto follows = follows_schema(nlohmann::json::parse(text), name);
    EXPECT_EQ(static_cast<bool>(follows), expected) << "schema: " << follows.message();
    if (!reader) continue;
    std::string message;
    try {
      reader(text);
    } catch (const Error& error) {
      message = error.what();
      EXPECT_FALSE(error.place().empty() && error.expected().empty());
    }
    EXPECT_EQ(message.empty(), expected) << "reader: " << message;
  }
  EXPECT_GE(valid, 1);
  EXPECT_GE(invalid, 2);
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
