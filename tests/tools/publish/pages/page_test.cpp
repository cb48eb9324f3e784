#include "tools/publish/pages/page.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::testing {
namespace {

TEST(Html, APageIsWellFormedWhateverItsTitle) {
  const std::string page =
      html_page("</title><script>alert(1)</script>", html_section("a", "A", "<p>x</p>\n"));
  EXPECT_EQ(page.find(std::string(kReportFirstLine)), 0u);
  EXPECT_EQ(tag_fault(page), "");
  EXPECT_EQ(page.find("<script"), std::string::npos);
}

TEST(Html, TheCheckFindsFaults) {
  EXPECT_NE(tag_fault("<p><b></p></b>"), "");
  EXPECT_NE(tag_fault("<p>"), "");
  EXPECT_NE(tag_fault("</p>"), "");
  EXPECT_EQ(tag_fault("<p title=\"a > b\"><img src=\"x\"></p><path d=\"M0 0\"/>"), "");
}

TEST(Filled, PutsValuesIntoTheirPlaces) {
  EXPECT_EQ(filled("a {{x}} b {{y}}{{x}}", {{"x", "1"}, {"y", "2"}}), "a 1 b 21");
  EXPECT_EQ(filled("nothing } to { do", {}), "nothing } to { do");
}

TEST(Filled, NeverLooksIntoAValue) { EXPECT_EQ(filled("{{x}}", {{"x", "{{y}}{{x}}"}}), "{{y}}{{x}}"); }

TEST(Filled, ANameWithoutAValueIsAMistakeOfOurs) { EXPECT_THROW(filled("{{z}}", {}), std::logic_error); }

}  // namespace
}  // namespace texmesh::testing
