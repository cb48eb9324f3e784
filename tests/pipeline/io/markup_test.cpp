#include "pipeline/io/markup.h"

#include <gtest/gtest.h>

namespace texmesh::markup_test {

TEST(Markup, WhatHasAMeaningThereIsEscaped) {
  EXPECT_EQ(markup_escaped("a<b>&\"c\"'d'"), "a&lt;b&gt;&amp;&quot;c&quot;&#39;d&#39;");
  EXPECT_EQ(markup_escaped("Figürchen"), "Figürchen");
  EXPECT_EQ(markup_escaped(""), "");
}

TEST(Markup, WhatIsNoUtf8IsReplaced) {
  EXPECT_EQ(markup_escaped("a\xff<"), "a\xef\xbf\xbd&lt;");
  EXPECT_EQ(markup_escaped("\xc3"), "\xef\xbf\xbd");
  EXPECT_EQ(markup_escaped("\xe2\x82z"), "\xef\xbf\xbd\xef\xbf\xbdz");  // a byte at a time
}

TEST(Markup, ControlCharactersDoNotPass) {
  EXPECT_EQ(markup_escaped("a\nb\tc\x01\x1f\r"), "a&#10;b&#9;c???");
  EXPECT_EQ(markup_escaped(std::string_view("\0x", 2)), "?x");
}

TEST(Markup, PageBeginsWithItsTitleEscapedAndItsPolicy) {
  const std::string with = page_beginning("<b> & c", "default-src 'none'");
  EXPECT_NE(with.find("<title>&lt;b&gt; &amp; c</title>\n"), std::string::npos);
  EXPECT_NE(with.find("content=\"default-src 'none'\""), std::string::npos);
  EXPECT_EQ(page_beginning("a", "").find("Content-Security-Policy"), std::string::npos);
}

}  // namespace texmesh::markup_test
