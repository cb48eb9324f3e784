// Every example of schemas/examples goes through its schema and, where the code has one, through the reader
// of such documents; both must say what the file's name says.
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <functional>
#include <map>
#include <nlohmann/json.hpp>
#include <valijson/adapters/nlohmann_json_adapter.hpp>
#include <valijson/schema.hpp>
#include <valijson/schema_parser.hpp>
#include <valijson/validator.hpp>

#include "format/documents/about.h"
#include "format/documents/manifest.h"
#include "format/documents/quality_table.h"
#include "format/documents/textures.h"
#include "format/rules/allocation.h"
#include "lab/experiment/design.h"
#include "lab/experiment/results.h"
#include "pipeline/about/meta.h"
#include "pipeline/batch/plan.h"
#include "pipeline/compile/options.h"
#include "pipeline/compile/profile.h"
#include "pipeline/import/range/range_scan_document.h"
#include "tools/inspect/fragment_files.h"
#include "tools/inspect/provenance.h"

namespace texmesh {
namespace {

namespace fs = std::filesystem;
using nlohmann::json;

const fs::path kSchemas = fs::path(TEXMESH_SOURCE_DIR) / "schemas";

std::string read_file(const fs::path& path) {
  std::ifstream in(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(in), {}};
}

std::span<const std::uint8_t> bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

/// Throws an Error when the document is not valid.
using Reader = std::function<void(const std::string& document)>;
const std::map<std::string, Reader>& readers() {
  static const std::map<std::string, Reader> map{
      {"manifest.v2", [](const std::string& s) { read_manifest(bytes_of(s)); }},
      {"about.v2", [](const std::string& s) { read_about(bytes_of(s)); }},
      {"meta.v1", [](const std::string& s) { read_meta(s, "meta.json", "meta"); }},
      {"textures.v2", [](const std::string& s) { read_textures(bytes_of(s)); }},
      {"quality.v2", [](const std::string& s) { read_quality(bytes_of(s)); }},
      {"provenance.v1", [](const std::string& s) { read_provenance(bytes_of(s)); }},
      {"fragments.v1", [](const std::string& s) { read_fragment_index(bytes_of(s)); }},
      {"collection.v1", [](const std::string& s) { read_collection(s, "collection.json", {}); }},
      {"range-scan.v1", [](const std::string& s) { read_range_scan_description("scan.json", bytes_of(s)); }},
      {"jnd-profile.v1",
       [](const std::string& s) {
         CompileOptions options;
         read_jnd_profile(options, bytes_of(s), "jnd.json");
       }},
      {"experiment-design.v1", [](const std::string& s) { read_design(bytes_of(s), "design.json"); }},
      {"experiment-results.v1", [](const std::string& s) { read_results(bytes_of(s), "results.json"); }},
      {"profile.v1", [](const std::string& s) {
         CompileOptions options;
         read_profile(options, s, "profile.json");
       }}};
  return map;
}

std::vector<std::string> schema_names() {
  const std::string suffix = ".schema.json";
  std::vector<std::string> names;
  for (const auto& e : fs::directory_iterator(kSchemas)) {
    const std::string name = e.path().filename().string();
    if (name.ends_with(suffix)) names.push_back(name.substr(0, name.size() - suffix.size()));
  }
  std::sort(names.begin(), names.end());
  return names;
}

class SchemaTest : public testing::TestWithParam<std::string> {
 protected:
  SchemaTest() {
    document_ = json::parse(read_file(kSchemas / (GetParam() + ".schema.json")));
    valijson::SchemaParser(valijson::SchemaParser::kDraft7)
        .populateSchema(valijson::adapters::NlohmannJsonAdapter(document_), schema_);
  }
  bool schema_accepts(const json& document) const {
    valijson::Validator validator;
    return validator.validate(schema_, valijson::adapters::NlohmannJsonAdapter(document), nullptr);
  }
  json document_;
  valijson::Schema schema_;
};

TEST_P(SchemaTest, SaysItsDraftAndTitle) {
  EXPECT_EQ(document_["$schema"], "http://json-schema.org/draft-07/schema#");
  EXPECT_TRUE(document_["title"].is_string());
  EXPECT_TRUE(document_["description"].is_string());
}

TEST_P(SchemaTest, AgreesWithExamplesAndReader) {
  int valid = 0, invalid = 0;
  const auto reader = readers().find(GetParam());
  for (const auto& e : fs::directory_iterator(kSchemas / "examples" / GetParam())) {
    SCOPED_TRACE(e.path().filename().string());
    const bool expected = e.path().filename().string().starts_with("valid-");
    ASSERT_TRUE(expected || e.path().filename().string().starts_with("invalid-"));
    ++(expected ? valid : invalid);
    const std::string text = read_file(e.path());
    EXPECT_EQ(schema_accepts(json::parse(text)), expected) << "schema";
    if (reader == readers().end()) continue;
    std::string message;
    try {
      reader->second(text);
    } catch (const Error& error) {
      message = error.what();
      EXPECT_FALSE(error.place().empty() && error.expected().empty());
    }
    EXPECT_EQ(message.empty(), expected) << "reader: " << message;
  }
  EXPECT_GE(valid, 1);
  EXPECT_GE(invalid, 2);
}

INSTANTIATE_TEST_SUITE_P(All, SchemaTest, testing::ValuesIn(schema_names()), [](const auto& test) {
  std::string name = test.param;
  std::replace_if(
      name.begin(), name.end(), [](char c) { return !std::isalnum(static_cast<unsigned char>(c)); }, '_');
  return name;
});

TEST(Collection, ModelOptionsStandOverThoseOfTheCollection) {
  const auto models = read_collection(
      R"({"version":1,"options":{"ssf":{"scales":7},"lut":{"quality_fine":90}},
          "models":[{"input":"a/b.glb","options":{"ssf":{"scales":9}}},{"input":"c.obj","output":"d/e.texmesh"}]})",
      "c.json", {});
  ASSERT_EQ(models.size(), 2u);
  EXPECT_EQ(models[0].output, "b.texmesh");
  EXPECT_EQ(models[0].options->ssf.scales, 9);
  EXPECT_EQ(models[0].options->lut.quality_fine, 90);
  EXPECT_EQ(models[1].output, "d/e.texmesh");
  EXPECT_EQ(models[1].options->ssf.scales, 7);
}

TEST(Collection, WhatIsSaidOfTheNearerPlaceWinsFieldByField) {
  const auto models = read_collection(
      R"({"version":1,"about":{"licence":"CC0-1.0","creator":"all"},"patterns":[{"match":"*.ply","about":{"unit":"mm"}}],
          "models":[{"input":"a.ply","about":{"creator":"one"}},{"input":"b.obj"}]})",
      "c.json", {});
  const auto about_of = [&](std::size_t i) {
    return read_about(bytes_of(models.at(i).options->package.meta));
  };
  EXPECT_EQ(about_of(0).licence, "CC0-1.0");
  EXPECT_EQ(about_of(0).creator, "one");
  EXPECT_EQ(about_of(0).metres_per_unit, 0.001);
  EXPECT_EQ(about_of(1).creator, "all");
  EXPECT_EQ(about_of(1).metres_per_unit, 0);
}

TEST(Collection, NamesThePlaceOfAFault) {
  const auto place_of = [](const std::string& text) {
    try {
      read_collection(text, "c.json", {});
    } catch (const InputError& e) {
      return e.place();
    }
    return std::string("no error");
  };
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a.glb","options":{"ssf":{"scales":99}}}]})"),
            "/models/0/options/ssf/scales");
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a.glb","about":{"licence":"CC-BY-9.0"}}]})"),
            "/models/0/about/licence");
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a/x.glb"},{"input":"b/x.glb"}]})"),
            "/models/1/output");
  EXPECT_EQ(place_of(R"({"version":1,"models":[{"input":"a/x.glb","output":"k/../x.texmesh"}]})"),
            "/models/0/output");
  EXPECT_NE(place_of("{\"version\":1,"), "no error");
  EXPECT_NE(place_of(std::string(100000, '[')), "no error");
}

}  // namespace
}  // namespace texmesh
