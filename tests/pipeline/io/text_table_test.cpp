#include <gtest/gtest.h>

#include "pipeline/io/text_table.h"

namespace texmesh {
namespace {

TEST(TextTable, AlignsNumbersRightAndTextLeft) {
  TextTable t;
  t.column("name", Align::kLeft);
  t.column("kB");
  t.row({"a", "1.0"});
  t.row({"longer name", "123.4"});
  t.row({"no number"});
  EXPECT_EQ(t.text(),
            "  name            kB\n"
            "  -----------  -----\n"
            "  a              1.0\n"
            "  longer name  123.4\n"
            "  no number\n");
}

TEST(TextTable, CountsCodePointsNotBytes) {
  TextTable t("");
  t.column("x", Align::kLeft);
  t.column("y", Align::kLeft);
  t.row({"\xc3\xa4\xc3\xb6", "1"});
  t.row({"abc", "2"});
  EXPECT_EQ(t.text(), "x    y\n---  -\n\xc3\xa4\xc3\xb6   1\nabc  2\n");
}

TEST(Printable, ReplacesWhatATerminalMustNotSee) {
  EXPECT_EQ(printable("Fig \xc3\xa4 \xf0\x9f\x97\xbf"), "Fig \xc3\xa4 \xf0\x9f\x97\xbf");
  EXPECT_EQ(printable("a\x1b[2Jb\n\x7f"), "a?[2Jb??");
  EXPECT_EQ(printable("\xc2\x9b"), "??");       // a C1 control character
  EXPECT_EQ(printable("\xed\xa0\x80"), "???");  // a surrogate
  EXPECT_EQ(printable("\xe2\x82"), "??");       // cut short
  EXPECT_EQ(printable("\xc0\xaf"), "??");       // overlong
}

}  // namespace
}  // namespace texmesh
