#include "pipeline/about/source_fields.h"

#include <gtest/gtest.h>

#include "format/base/errors.h"

namespace texmesh::meta_test {

std::string place_of(const std::string& json) {
  try {
    read_meta(json, "m.json", "about");
  } catch (const InputError& e) {
    EXPECT_EQ(e.file(), "m.json");
    EXPECT_FALSE(e.expected().empty());
    return e.place();
  }
  return "no error";
}

TEST(Meta, CanonicalTextWhateverTheSpelling) {
  const std::string text =
      read_meta(R"({ "licence" : "cc-by-4.0", "$schema":"x", "unit":"mm", "title":"A" })", "m");
  EXPECT_EQ(text,
            R"({"title":"A","licence":"CC-BY-4.0","licenceUrl":"https://spdx.org/licenses/CC-BY-4.0.html",)"
            R"("unit":{"name":"mm","metres":0.001}})");
  EXPECT_EQ(read_meta(text, "m"), text);
  EXPECT_EQ(read_meta("{}", "m"), "");
  EXPECT_EQ(read_meta(R"({"licence":"CC-BY-4.0","licenceUrl":"https://a.b/"})", "m"),
            R"({"licence":"CC-BY-4.0","licenceUrl":"https://a.b/"})");
}

TEST(Meta, NamesTheFieldThatIsWrong) {
  EXPECT_EQ(place_of(R"({"licence":"CC-BY-9.0"})"), "about/licence");
  EXPECT_EQ(place_of(R"({"licence":"MIT OR Foo"})"), "about/licence");
  EXPECT_EQ(place_of(R"({"coordinateReference":{"epsg":99999}})"), "about/coordinateReference/epsg");
  EXPECT_EQ(place_of(R"({"coordinateReference":{"EPSG":4326}})"), "about/coordinateReference/EPSG");
  EXPECT_EQ(place_of(R"({"author":"x"})"), "about/author");
  EXPECT_EQ(place_of(R"({"source":{}})"), "about/source");
  EXPECT_EQ(place_of(R"({"unit":"cubit"})"), "about/unit");
  EXPECT_EQ(place_of(R"({"unit":7})"), "about/unit");
  EXPECT_EQ(place_of(R"({"title":""})"), "about/title");
  EXPECT_EQ(place_of(R"({"licence":3})"), "about/licence");
  EXPECT_EQ(place_of(R"({"identifiers":[{"scheme":"a","value":"b","c":"d"}]})"), "about/identifiers/0/c");
  EXPECT_EQ(place_of("[]"), "about");
  EXPECT_TRUE(place_of("{\"title\":").starts_with("byte "));
  EXPECT_NE(place_of(std::string(100000, '[')), "no error");
  EXPECT_NE(place_of("\"" + std::string(300000, 'x') + "\""), "no error");
}

TEST(Meta, MergesFieldByField) {
  EXPECT_EQ(merge_meta("", ""), "");
  EXPECT_EQ(merge_meta(R"({"title":"A","unit":"mm"})", R"({"title":"B"})"),
            R"({"title":"B","unit":{"name":"mm","metres":0.001}})");
  EXPECT_EQ(up_axis_of_meta(R"({"upAxis":"z"})"), "z");
  EXPECT_EQ(up_axis_of_meta(""), "");
  EXPECT_EQ(up_axis_of_meta("{}"), "");
}

}  // namespace texmesh::meta_test
