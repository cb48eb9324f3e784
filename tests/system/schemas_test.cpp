// Every example of schemas/examples goes through its schema and, where the code has one, through the reader
// of such documents; both must say what the file's name says.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <map>
#include <span>

#include "format/documents/annotations.h"
#include "format/documents/manifest.h"
#include "format/documents/quality_table.h"
#include "format/documents/textures.h"
#include "format/rules/allocation.h"
#include "pipeline/about/source_fields.h"
#include "pipeline/batch/plan.h"
#include "pipeline/compile/options.h"
#include "pipeline/import/range/import_range.h"
#include "tests/support/schema.h"
#include "tools/inspect/package_tree.h"
#include "tools/inspect/provenance.h"

namespace texmesh::schemas_test {

std::span<const std::uint8_t> bytes_of(const std::string& s) {
  return {reinterpret_cast<const std::uint8_t*>(s.data()), s.size()};
}

/// Throws an Error when the document is not valid.
using Reader = std::function<void(const std::string& document)>;
const std::map<std::string, Reader>& readers() {
  static const std::map<std::string, Reader> map{
      {"manifest.v2", [](const std::string& s) { read_manifest(bytes_of(s)); }},
      {"about.v2", [](const std::string& s) { read_about(bytes_of(s)); }},
      {"annotations.v2", [](const std::string& s) { read_annotations(bytes_of(s), "a.json"); }},
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
      {"profile.v1", [](const std::string& s) {
         CompileOptions options;
         read_profile(options, s, "profile.json");
       }}};
  return map;
}

class SchemaTest : public ::testing::TestWithParam<std::string> {};

TEST_P(SchemaTest, AgreesWithExamplesAndReader) {
  const auto reader = readers().find(GetParam());
  testing::check_examples("schemas", GetParam(), reader == readers().end() ? Reader() : reader->second);
}

INSTANTIATE_TEST_SUITE_P(All, SchemaTest, ::testing::ValuesIn(testing::schema_names("schemas")),
                         [](const auto& test) {
                           std::string name = test.param;
                           std::replace(name.begin(), name.end(), '-', '_');
                           std::replace(name.begin(), name.end(), '.', '_');
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

}  // namespace texmesh::schemas_test
