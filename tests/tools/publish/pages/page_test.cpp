#include "tools/publish/pages/page.h"

#include <gtest/gtest.h>

#include <stdexcept>

#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::testing::page_test {

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

TEST(RightsLine, LinksTheCreatorsPageWhereNoOtherLineIsAskedFor) {
  About about;
  about.creator = "N. <N.>", about.identifiers = {{"creator", "https://a.example/?n&m"}};
  EXPECT_EQ(rights_line(about),
            "<p class=\"quiet\"><a href=\"https://a.example/?n&amp;m\">N. &lt;N.&gt;</a></p>\n");
  about.identifiers[0].text = "javascript:alert(1)";
  EXPECT_EQ(rights_line(about), "<p class=\"quiet\">N. &lt;N.&gt;</p>\n");
  about.identifiers[0].text = "https://a.example", about.attribution = "by N.";
  EXPECT_EQ(rights_line(about), "<p class=\"quiet\">by N.</p>\n");
}

TEST(ReadableTitle, IsWhatPeopleWouldWrite) {
  EXPECT_EQ(readable_title("packages/apple_food-01.texmesh"), "Apple food 01");
  EXPECT_EQ(readable_title("a/Schildkr\xc3\xb6te gro\xc3\x9f.texmesh/"), "Schildkr\xc3\xb6te gro\xc3\x9f");
  EXPECT_EQ(readable_title("FlightHelmet.texmesh"), "Flight Helmet");
  EXPECT_EQ(readable_title("USS_Monitor3D"), "USS Monitor3D") << "no name of a word is taken apart";
  EXPECT_EQ(readable_title("__v1.2__"), "V1.2");
  EXPECT_EQ(readable_title("-.texmesh"), "-") << "better than nothing";
}

TEST(SidesInWords, UseTheUnitOfTheLongest) {
  EXPECT_EQ(sides_in_words({1.23, 0.5, 12.34}), "1.2 x 0.5 x 12 m");
  EXPECT_EQ(sides_in_words({0.123, 0.085, 0.3}), "12 x 8.5 x 30 cm");
  EXPECT_EQ(sides_in_words({0.001, 0.0099, 0}), "1 x 9.9 x 0 mm");
  EXPECT_EQ(sides_in_words({12345, 1, 1}), "12345 x 1 x 1 m");
}

}  // namespace texmesh::testing::page_test
