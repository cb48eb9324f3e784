#include "tools/publish/report/html.h"

#include <gtest/gtest.h>

#include "tests/tools/publish/report/html_check.h"

namespace texmesh::testing {
namespace {

TEST(Html, APageIsWellFormedWhateverItsTitle) {
  const std::string page =
      html_page("</title><script>alert(1)</script>", html_section("a", "A", "<p>x</p>\n"));
  EXPECT_EQ(page.find(std::string(kReportFirstLine)), 0u);
  EXPECT_EQ(tag_fault(page), "");
  EXPECT_EQ(page.find("<script"), std::string::npos);
}

TEST(Html, TablesHaveHeadersOfRowsAndColumns) {
  const std::string html = HtmlTable{"Things", {"A", "B"}, {{"1", "2"}, {"3", "4"}}}.html();
  EXPECT_EQ(tag_fault(html), "");
  EXPECT_NE(html.find("<caption>Things</caption>"), std::string::npos);
  EXPECT_NE(html.find("<th scope=\"row\">3</th><td>4</td>"), std::string::npos);
}

TEST(Html, TheCheckFindsFaults) {
  EXPECT_NE(tag_fault("<p><b></p></b>"), "");
  EXPECT_NE(tag_fault("<p>"), "");
  EXPECT_NE(tag_fault("</p>"), "");
  EXPECT_EQ(tag_fault("<p title=\"a > b\"><img src=\"x\"></p><path d=\"M0 0\"/>"), "");
}

}  // namespace
}  // namespace texmesh::testing
