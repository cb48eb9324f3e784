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
  EXPECT_TRUE(place_of("{\"title\":").starts_with("line 1"));
  EXPECT_NE(place_of(std::string(100000, '[')), "no error");
  EXPECT_NE(place_of("\"" + std::string(300000, 'x') + "\""), "no error");
}

TEST(Meta, SaysWhatMayHaveBeenMeant) {
  const auto told = [](const std::string& json) -> std::string {
    try {
      return read_meta(json, "m.json");
    } catch (const InputError& e) {
      return e.what();
    }
  };
  const std::pair<const char*, const char*> licences[] = {
      {"CC BY 4.0", "CC-BY-4.0"},
      {"Creative Commons Attribution 4.0 International", "CC-BY-4.0"},
      {"CC BY-SA", "CC-BY-SA-4.0"},
      {"Attribution-NonCommercial 3.0", "CC-BY-NC-3.0"},
      {"CC-BY 4", "CC-BY-4.0"},
      {"CC0", "CC0-1.0"},
      {"GPLv3", "GPL-3.0"},
      {"ODbL", "ODbL-1.0"},
      {"Apache License 2", "Apache-2.0"}};
  for (const auto& [written, meant] : licences)
    EXPECT_NE(told(R"({"licence":")" + std::string(written) + "\"}")
                  .find("did you mean " + std::string(meant) + "?"),
              std::string::npos)
        << written;
  EXPECT_EQ(told(R"({"licence":"All rights reserved"})").find("did you mean"), std::string::npos);
  EXPECT_NE(told(R"({"license":"MIT"})").find("did you mean licence?"), std::string::npos);
  EXPECT_NE(told(R"({"upAxis":"up"})").find("x, y or z"), std::string::npos);
  EXPECT_EQ(told(R"({"upAxis":"Z"})"), R"({"upAxis":"z"})");
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
