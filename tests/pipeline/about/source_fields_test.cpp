#include "pipeline/about/source_fields.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace texmesh::source_fields_test {

TEST(SourceFields, CommentsOfTheListGiveFieldsAndOthersAreIgnored) {
  Notes notes;
  const std::vector<std::string> comments{" Author: A. Smith",
                                          "licence: cc-by-4.0",
                                          "Unit: mm",
                                          "CRS: EPSG:25832",
                                          "up axis: Z",
                                          "TextureFile a.png",
                                          "Created by: a tool 1.2",
                                          "http://www.tool.example/",
                                          "date: 1897?",
                                          "capture_method: turntable"};
  const About a = about_from_comments(comments, "ply", notes);
  EXPECT_EQ(a.creator, "A. Smith");
  EXPECT_EQ(a.licence, "CC-BY-4.0");
  EXPECT_EQ(a.licence_url, "https://spdx.org/licenses/CC-BY-4.0.html");
  EXPECT_EQ(a.metres_per_unit, 0.001);
  EXPECT_EQ(a.epsg, 25832u);
  EXPECT_EQ(a.up_axis, "z");
  EXPECT_EQ(a.dates, (std::vector<NamedText>{{"date", "1897?"}}));
  EXPECT_EQ(a.capture, "turntable");
  EXPECT_EQ(a.title, "");
  EXPECT_TRUE(notes.empty());
  const auto source = nlohmann::json::parse(a.source);
  EXPECT_EQ(source["format"], "ply");
  EXPECT_EQ(source["comments"].size(), 7u);
  EXPECT_EQ(source["comments"][0], "Author: A. Smith");
}

TEST(SourceFields, ValuesThatMakeNoSenseCostANoteAndNothingElse) {
  for (const auto& [name, value] : {std::pair{"unit", "cubit"},
                                    {"epsg", "1"},
                                    {"crs", "EPSG:x"},
                                    {"up", "w"},
                                    {"source", "javascript:alert(1)"}}) {
    Notes notes;
    About a;
    EXPECT_TRUE(set_source_field(a, name, value, "comment", notes)) << name;
    EXPECT_EQ(a, About()) << name;
    ASSERT_EQ(notes.size(), 1u) << name;
    EXPECT_EQ(notes[0].code, "about-value");
  }
  Notes notes;
  About a;
  EXPECT_TRUE(set_source_field(a, "license", "ask me", "comment", notes));
  EXPECT_EQ(a.licence, "ask me");
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].code, "unknown-licence");
  EXPECT_EQ(notes[0].severity, Severity::kInfo);
}

TEST(SourceFields, AnAuthorWithAnAddressIsACreatorWithAPage) {
  const auto said = [](const std::string& value) {
    Notes notes;
    About a;
    a.identifiers = {{"doi", "10.1/2"}, {"creator", "https://other.example"}};
    EXPECT_TRUE(set_source_field(a, "author", value, "/asset/extras", notes));
    EXPECT_EQ(a.identifiers[0].text, "10.1/2");
    return std::pair(a.creator, creator_url(a));
  };
  using Said = std::pair<std::string, std::string>;
  EXPECT_EQ(said("N. N. (https://sketchfab.com/nn)"), (Said{"N. N.", "https://sketchfab.com/nn"}));
  EXPECT_EQ(said("N. (Museum) (http://a.example/b?c=(d))"),
            (Said{"N. (Museum)", "http://a.example/b?c=(d)"}));
  for (const std::string text :
       {"N. N.", "N. N. (Museum)", "N. N. (javascript:alert(1))", "(https://a.example)",
        "N. N. https://a.example", "N. N. (https://a.example) and others"})
    EXPECT_EQ(said(text), (Said{text, ""}));
}

TEST(SourceFields, StrangersTextsAreMadeFitToShow) {
  EXPECT_EQ(clean_about_text(" \ta\nb \x1b[31m\xff ", 100), "a b ?[31m?");
  EXPECT_EQ(clean_about_text("\xc3\xa4\xc3\xa4", 3), "\xc3\xa4");
  EXPECT_EQ(clean_about_text(" \r\n", 10), "");
  Notes notes;
  const About a =
      about_from_comments(std::vector<std::string>(500, "date: x" + std::string(5000, 'y')), "obj", notes);
  EXPECT_EQ(a.dates.size(), 1u);  // the same text once
  EXPECT_LE(a.source.size(), kMaxAboutSourceBytes);
  EXPECT_NO_THROW(write_about(a));
}

TEST(SourceFields, ObjCommentsAreLinesOfTheHead) {
  const auto comments = obj_comments("# a: 1\r\nv 0 0 0 # unit: m\n#b\n\n#");
  EXPECT_EQ(comments, (std::vector<std::string>{" a: 1", "b", ""}));
  EXPECT_TRUE(obj_comments("").empty());
  const std::string late = std::string(70000, '\n') + "# author: late";
  EXPECT_TRUE(obj_comments(late).empty());
}

TEST(SourceFields, UnitsByName) {
  for (const auto& [name, metres] :
       {std::pair{"M", 1.0}, {"Metre", 1.0}, {"inches", 0.0254}, {"ft", 0.3048}}) {
    About a;
    EXPECT_TRUE(find_unit(name, a));
    EXPECT_EQ(a.metres_per_unit, metres);
  }
  About a;
  EXPECT_FALSE(find_unit("", a));
}

}  // namespace texmesh::source_fields_test
