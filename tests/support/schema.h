// Documents against the JSON Schemas of schemas/.
#pragma once

#include <gtest/gtest.h>

#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace texmesh::testing {

/// A schema of schemas/ or lab/schemas/ by its name: "event.v1".
nlohmann::json schema_document(const std::string& name);

/// Whether the document follows the schema; says where not.
::testing::AssertionResult follows_schema(const nlohmann::json& document, const std::string& name);

/// The names of the schemas in this folder of the project, sorted.
std::vector<std::string> schema_names(const std::string& folder);

/// Expects that the schema says its draft, title and description, and that it and `reader`, which throws an
/// Error for a document that is not valid (empty: there is no reader), agree with the names of the examples:
/// valid-*.json and invalid-*.json of examples/NAME.
void check_examples(const std::string& folder, const std::string& name,
                    const std::function<void(const std::string& document)>& reader);

}  // namespace texmesh::testing
