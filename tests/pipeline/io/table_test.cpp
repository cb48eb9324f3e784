#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pipeline/io/table.h"

namespace texmesh::table_test {

TEST(Table, TextAlignsNumbersRightAndTextLeft) {
  Table t("", {Column::text("name"), {"kB", 1}});
  t.row({"a", 1.0});
  t.row({"longer name", 123.4});
  t.row({"no number"});
  EXPECT_EQ(t.text(),
            "  name            kB\n"
            "  -----------  -----\n"
            "  a              1.0\n"
            "  longer name  123.4\n"
            "  no number\n");
}

TEST(Table, TextCountsCodePointsNotBytes) {
  Table t("", {Column::text("x"), Column::text("y")});
  t.row({"\xc3\xa4\xc3\xb6", "1"});
  t.row({"abc", "2"});
  EXPECT_EQ(t.text(""), "x    y\n---  -\n\xc3\xa4\xc3\xb6   1\nabc  2\n");
}

/// Two rows of every kind of value.
Table scales() {
  Table t("Scales <of> a \"scan\"", {{"scale", kScaleName, "scale"},
                                     {"triangles", kGrouped, "triangles"},
                                     {"kB", kKilobytes, "bytes"},
                                     {"p95", percent_form(2), "p95", "%"},
                                     {"flip", 0, "px", "px"},
                                     {"major", {}, "major"},
                                     Column::data("path")});
  t.row({0, 97394u, 1234567u, 0.0123, {1e300, "any"}, true, "mesh/0.glb"});
  t.row({12, 7u, 999u, 0.5f, 64.4, false, "a, \"b\""});
  return t;
}

TEST(Table, NumbersAreShownByTheirForms) {
  EXPECT_EQ(scales().text(""),
            "Scales <of> a \"scan\"\n"
            "scale  triangles      kB  p95 [%]  flip [px]  major\n"
            "-----  ---------  ------  -------  ---------  -----\n"
            "  S_0     97 394  1234.6     1.23        any    yes\n"
            " S_12          7     1.0    50.00         64\n");
}

TEST(Table, JsonHasValuesInFull) {
  const nlohmann::ordered_json j = scales().json();
  EXPECT_EQ(j[0].dump(),
            R"({"scale":0,"triangles":97394,"bytes":1234567,"p95":0.0123,"px":1e+300,"major":true,)"
            R"("path":"mesh/0.glb"})");
  EXPECT_EQ(j[1]["p95"], 0.5);
  EXPECT_EQ(j[1]["major"], false);
  Table t("", {Column::text("a", "a"), {"b", {}, "b"}, {"not in JSON"}});
  t.row({std::optional<int>()});
  EXPECT_EQ(t.json().dump(), R"([{"a":null,"b":null}])");
  EXPECT_EQ(t.json_document().dump(),
            R"({"caption":"","columns":["a","b","not in JSON"],"rows":[[null,null,null]]})");
}

TEST(Table, CsvQuotesWhatHasCommasAndQuotes) {
  EXPECT_EQ(scales().csv(),
            "scale,triangles,bytes,p95,px,major,path\n"
            "0,97394,1234567,0.0123,1e+300,true,mesh/0.glb\n"
            "12,7,999,0.5,64.4,false,\"a, \"\"b\"\"\"\n");
  Table empty("", {{"a", 0, "a"}, {"b", 0, "b"}});
  empty.row({Cell(), 1});
  EXPECT_EQ(empty.csv(), "a,b\n,1\n");
}

TEST(Table, HtmlEscapesTextsAndKeepsMarkup) {
  const std::string html = scales().html();
  EXPECT_EQ(html.find("<of>"), std::string::npos);
  EXPECT_NE(
      html.find("<div class=\"scroll\"><table>\n<caption>Scales &lt;of&gt; a &quot;scan&quot;</caption>"),
      std::string::npos)
      << html;
  EXPECT_NE(html.find("<tr><th scope=\"row\">S_0</th><td>97\xe2\x80\xaf"
                      "394</td><td>1234.6</td><td>1.23</td><td>any</td><td>yes</td></tr>"),
            std::string::npos)
      << html;
  Table t("", {Column::text("model"), Column::text("found")});
  t.row({Cell::markup("x", "<a href=\"#x\">x</a>"), "<b>"});
  EXPECT_NE(t.html().find("<table class=\"sentences\">"), std::string::npos);
  EXPECT_NE(t.html().find("<th scope=\"row\"><a href=\"#x\">x</a></th><td>&lt;b&gt;</td>"),
            std::string::npos);
  EXPECT_NE(t.text().find("  x      <b>\n"), std::string::npos) << t.text();
}

TEST(Numbers, AreShortAndReadable) {
  EXPECT_EQ(grouped(0), "0");
  EXPECT_EQ(grouped(999), "999");
  EXPECT_EQ(grouped(1000), "1 000");
  EXPECT_EQ(grouped(1234567), "1 234 567");
  EXPECT_EQ(shortest(0.012345678), "0.01235");
  EXPECT_EQ(shortest(153.2), "153.2");
  EXPECT_EQ(shortest(12345.6), "12346");
  EXPECT_EQ(shortest(0), "0");
  EXPECT_EQ(fixed(2.0 / 3, 2), "0.67");
  EXPECT_EQ(percent(0.0123), "1.2");
  EXPECT_EQ(thin_grouped(1234567),
            "1\xe2\x80\xaf"
            "234\xe2\x80\xaf"
            "567");
  EXPECT_EQ(format_bytes(12), "12 B");
  EXPECT_EQ(format_bytes(340000), "340 kB");
  EXPECT_EQ(format_bytes(1234560), "1.23 MB");
}

TEST(Printable, ReplacesWhatATerminalMustNotSee) {
  EXPECT_EQ(printable("Fig \xc3\xa4 \xf0\x9f\x97\xbf"), "Fig \xc3\xa4 \xf0\x9f\x97\xbf");
  EXPECT_EQ(printable("a\x1b[2Jb\n\x7f"), "a?[2Jb??");
  EXPECT_EQ(printable("\xc2\x9b"), "??");       // a C1 control character
  EXPECT_EQ(printable("\xed\xa0\x80"), "???");  // a surrogate
  EXPECT_EQ(printable("\xe2\x82"), "??");       // cut short
  EXPECT_EQ(printable("\xc0\xaf"), "??");       // overlong
}

}  // namespace texmesh::table_test
