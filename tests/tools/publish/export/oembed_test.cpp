#include "tools/publish/export/export.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::oembed_test {

using Json = nlohmann::json;

EmbeddedObject bust() {
  EmbeddedObject o;
  o.about.title = "A \"bust\" <script>";
  o.about.creator = "A. Smith";
  o.about.licence = "CC-BY-4.0";
  o.about.licence_url = "https://creativecommons.org/licenses/by/4.0/";
  o.page_url = "https://museum.example/bust/viewer/index.html?panel=none&pkg=../object.texmesh";
  o.thumbnail_url = "https://museum.example/bust/poster.jpg";
  o.thumbnail_width_px = 320;
  o.thumbnail_height_px = 240;
  o.provider_name = "museum.example";
  o.provider_url = "https://museum.example";
  return o;
}

TEST(Oembed, HasWhatTheTypeRichRequires) {
  const Json j = Json::parse(oembed_answer(bust()));
  EXPECT_EQ(j["type"], "rich");
  EXPECT_EQ(j["version"], "1.0");
  EXPECT_EQ(j["width"], 640);
  EXPECT_EQ(j["height"], 480);
  EXPECT_EQ(j["title"], "A \"bust\" <script>");  // JSON, not HTML
  EXPECT_EQ(j["author_name"], "A. Smith");
  EXPECT_EQ(j["thumbnail_width"], 320);
  EXPECT_EQ(j["license"], "CC-BY-4.0");
  const std::string html = j["html"];
  EXPECT_EQ(testing::tag_fault(html), "");
  EXPECT_EQ(html.find("<script"), std::string::npos);
  EXPECT_EQ(testing::attributes(html, "src").at(0),
            "https://museum.example/bust/viewer/index.html?panel=none&amp;pkg=../object.texmesh");
}

TEST(Oembed, WhatIsNotKnownIsLeftOut) {
  EmbeddedObject o = bust();
  o.about = {};
  o.thumbnail_url.clear();
  const Json j = Json::parse(oembed_answer(o));
  for (const char* name :
       {"title", "author_name", "license", "license_url", "thumbnail_url", "thumbnail_width"})
    EXPECT_FALSE(j.contains(name)) << name;
}

}  // namespace texmesh::oembed_test
