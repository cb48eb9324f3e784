#include "pipeline/about/gltf_about.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

namespace texmesh::xmp_test {

using nlohmann::json;
using nlohmann::ordered_json;

About about_of(const std::string& packet, Notes* notes = nullptr) {
  Notes own;
  About about;
  apply_xmp(about, json::parse(packet), "xmp", notes ? *notes : own);
  return about;
}

TEST(Xmp, EveryShapeOfAText) {
  for (
      const char* value :
      {R"("A")", R"(["A"])", R"({"@value":"A"})", R"({"@list":["A"]})", R"({"@set":[{"@value":"A"}]})",
       R"({"@type":"rdf:Alt","rdf:_1":{"@language":"de","@value":"B"},"rdf:_2":{"@language":"x-default","@value":"A"}})",
       R"({"@type":"rdf:Alt","rdf:_1":{"@language":"de","@value":"B"},"rdf:_2":{"@language":"en-us","@value":"A"}})",
       R"({"@type":"rdf:Seq","rdf:_1":"A"})"})
    EXPECT_EQ(about_of(std::string(R"({"dc:title":)") + value + "}").title, "A") << value;
  for (const char* value : {"null", "true", "{}", "[]", R"({"rdf:_2":"A"})"})
    EXPECT_EQ(about_of(std::string(R"({"dc:title":)") + value + "}").title, "") << value;
  EXPECT_EQ(about_of("3"), About());
}

TEST(Xmp, DublinCoreAndRights) {
  const About a = about_of(R"({
    "@context":{"d":"http://purl.org/dc/elements/1.1/","xmpRights":"http://ns.adobe.com/xap/1.0/rights/"},
    "d:creator":{"@list":["A. Smith","B. Jones"]},"d:rights":"Museum, all rights","d:identifier":["17",18],
    "d:date":"1897","d:source":"https://museum.example/17","xmp:CreateDate":"2020-01-02",
    "xmpRights:UsageTerms":"CC-BY-4.0","xmpRights:WebStatement":"https://museum.example/terms"})");
  EXPECT_EQ(a.creator, "A. Smith; B. Jones");
  EXPECT_EQ(a.attribution, "Museum, all rights");
  EXPECT_EQ(a.licence, "CC-BY-4.0");
  EXPECT_EQ(a.licence_url, "https://museum.example/terms");
  EXPECT_EQ(a.source_url, "https://museum.example/17");
  EXPECT_EQ(a.identifiers, (std::vector<NamedText>{{"dc:identifier", "17"}, {"dc:identifier", "18"}}));
  EXPECT_EQ(a.dates, (std::vector<NamedText>{{"dc:date", "1897"}, {"xmp:CreateDate", "2020-01-02"}}));
}

TEST(Xmp, RightsThatNameALicenceAreTheLicence) {
  EXPECT_EQ(about_of(R"({"dc:rights":"CC0-1.0"})").licence, "CC0-1.0");
  EXPECT_EQ(about_of(R"({"dc:rights":"CC0-1.0"})").attribution, "");
  EXPECT_EQ(about_of(R"({"xmpRights:WebStatement":"https://a.b/c"})").licence, "https://a.b/c");
  EXPECT_EQ(about_of(R"({"xmpRights:WebStatement":"javascript:alert"})"), About());
  Notes notes;
  EXPECT_EQ(about_of(R"({"xmpRights:UsageTerms":"ask"})", &notes).licence, "ask");
  ASSERT_EQ(notes.size(), 1u);
  EXPECT_EQ(notes[0].code, "unknown-licence");
}

TEST(Xmp, APacketSaysWhatItWasMadeOf) {
  About a;
  a.title = "Bust";
  a.creator = "A. Smith";
  a.attribution = "Museum";
  a.licence = "CC-BY-4.0";
  a.licence_url = "https://spdx.org/licenses/CC-BY-4.0.html";
  a.description = "of a man";
  a.source_url = "https://museum.example/17";
  a.identifiers = {{"dc:identifier", "17"}};
  const ordered_json packet = xmp_packet(a, ordered_json::object());
  EXPECT_EQ(about_of(packet.dump()), a);
  EXPECT_EQ(xmp_packet(a, packet), packet);  // nothing to say anew
  EXPECT_EQ(packet["@context"]["dc"], "http://purl.org/dc/elements/1.1/");
  EXPECT_EQ(xmp_packet({}, ordered_json::object()), ordered_json::object());
}

TEST(Xmp, WhatThePacketHasBesideStays) {
  const ordered_json before =
      ordered_json::parse(R"({"@context":{"m":"urn:m"},"m:room":4,"dc:title":"Old","dc:date":"1897"})");
  About a;
  a.title = "New";
  const ordered_json after = xmp_packet(a, before);
  EXPECT_EQ(after["m:room"], 4);
  EXPECT_EQ(after["dc:date"], "1897");
  EXPECT_EQ(after["@context"]["m"], "urn:m");
  EXPECT_EQ(about_of(after.dump()).title, "New");
}

}  // namespace texmesh::xmp_test
