#include "lab/thesis/exhibits.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::exhibit_page_test {

Exhibit small_exhibit() {
  Exhibit e{"9.9", "Table 9.9: <b> & so on", "printed", "made", {}, Verdict::kNotConfirmed, "no <more>"};
  e.tables = {{"values",
               {{"row", 0}, {"printed", 3}, {"ours", 1}},
               {{std::string("a & b"), 0.12345, Cell{}}, {std::string("c"), std::string("none"), -2.25}}}};
  e.plots = {{"a plot",
              "x",
              "y",
              0,
              10,
              1,
              -1,
              true,
              {{"line", "a", {{0, -1}, {10, 1}}, true, false, false, false}}}};
  e.pictures = {{"x.png", "a \"picture\"", 4, 3, {1, 2, 3}}};
  return e;
}

TEST(ExhibitPage, IsWellFormedAndAsksForNothingElsewhere) {
  const std::string page = exhibits_html({small_exhibit()});
  EXPECT_EQ(testing::tag_fault(page), "");
  EXPECT_EQ(page.find("http"), page.find("http-equiv"));
  EXPECT_EQ(page.find("http", page.find("http-equiv") + 4), std::string::npos);
  EXPECT_EQ(page.find("<script"), std::string::npos);
  EXPECT_NE(page.find("src=\"x.png\" alt=\"a &quot;picture&quot;\" width=\"4\" height=\"3\""),
            std::string::npos);
  EXPECT_NE(page.find("prefers-color-scheme:dark"), std::string::npos);
  EXPECT_NE(page.find("@media print"), std::string::npos);
}

TEST(ExhibitPage, ShowsNumbersWithTheColumnsDigits) {
  const std::string page = exhibits_html({small_exhibit()});
  EXPECT_NE(page.find("<th scope=\"row\">a &amp; b</th><td>0.123</td><td></td>"), std::string::npos) << page;
  EXPECT_NE(page.find("<td>none</td><td>-2.2</td>"), std::string::npos);
  EXPECT_NE(page.find("Table 9.9: &lt;b&gt; &amp; so on"), std::string::npos);
  EXPECT_NE(page.find("not confirmed"), std::string::npos);
  EXPECT_NE(page.find("href=\"#x9-9\""), std::string::npos);
  EXPECT_NE(page.find("id=\"x9-9\""), std::string::npos);
}

TEST(ExhibitPage, JsonHasNumbersInFull) {
  const nlohmann::ordered_json json = exhibits_json({small_exhibit()});
  EXPECT_EQ(json["version"], 1);
  const auto& e = json["exhibits"][0];
  EXPECT_EQ(e["id"], "9.9");
  EXPECT_EQ(e["verdict"], "not confirmed");
  EXPECT_EQ(e["tables"][0]["columns"], nlohmann::json({"row", "printed", "ours"}));
  EXPECT_EQ(e["tables"][0]["rows"][0], nlohmann::json({"a & b", 0.12345, nullptr}));
}

TEST(ExhibitPage, TextEndsWithTheVerdict) {
  const std::string text = exhibit_text(small_exhibit());
  EXPECT_NE(text.find("a & b"), std::string::npos);
  EXPECT_TRUE(text.ends_with("\nnot confirmed: no <more>\n")) << text;
}

TEST(Exhibits, EveryIdStandsOnceAndTablesOfTheThesisAreThere) {
  std::vector<std::string> ids;
  for (const ExhibitGroup& group : exhibit_groups())
    ids.insert(ids.end(), group.ids.begin(), group.ids.end());
  for (const char* id :
       {"2.1", "3.1", "4.1", "4.2", "7.1", "7.2", "7.3", "fig-2.2", "fig-3.5", "fig-3.9", "fig-4.5",
        "fig-4.6", "fig-4.7", "fig-6.2", "fig-8.2", "fig-8.3", "fig-8.4", "fig-8.5"})
    EXPECT_EQ(std::count(ids.begin(), ids.end(), id), 1) << id;
  EXPECT_TRUE(make_exhibits({"no such id"}, {}).empty());
}

}  // namespace texmesh::exhibit_page_test
