// Every example of lab/schemas/examples goes through its schema and, where the code has one, its reader.
#include <functional>
#include <map>
#include <span>

#include "lab/experiment/design.h"
#include "tests/support/schema.h"

namespace texmesh::schemas_test {

std::span<const std::uint8_t> bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

TEST(LabSchemas, AgreeWithExamplesAndReaders) {
  const std::map<std::string, std::function<void(const std::string&)>> readers{
      {"experiment-design.v1", [](const std::string& s) { read_design(bytes_of(s), "design.json"); }},
      {"experiment-results.v1", [](const std::string& s) { read_results(bytes_of(s), "results.json"); }}};
  const std::vector<std::string> names = testing::schema_names("lab/schemas");
  EXPECT_EQ(names.size(), 4u);
  for (const std::string& name : names) {
    SCOPED_TRACE(name);
    const auto reader = readers.find(name);
    testing::check_examples(
        "lab/schemas", name,
        reader == readers.end() ? std::function<void(const std::string&)>() : reader->second);
  }
}

}  // namespace texmesh::schemas_test
