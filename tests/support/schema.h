// Documents against the JSON Schemas of schemas/.
#pragma once

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>

namespace texmesh::testing {

/// A schema of schemas/ by its name: "event.v1".
nlohmann::json schema_document(const std::string& name);

/// Whether the document follows the schema; says where not.
::testing::AssertionResult follows_schema(const nlohmann::json& document, const std::string& name);

}  // namespace texmesh::testing
