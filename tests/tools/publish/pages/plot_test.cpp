#include "tools/publish/pages/page.h"

#include <gtest/gtest.h>

#include "tests/tools/publish/pages/html_check.h"

namespace texmesh::testing::plot_test {

Plot sample() {
  Plot plot;
  plot.title = "A \"plot\" <of> things";
  plot.x_name = "bytes";
  plot.y_name = "FLIP";
  plot.x_low = 1000, plot.x_high = 1e6, plot.y_high = 0.37;
  plot.series.push_back({"first", "a", {{1000, 0.37}, {1e5, 0.1}, {1e6, 0}}, true});
  plot.series.push_back({"steps", "b", {{1000, 0.2}, {1e6, 0.1}}, false, true, false, true});
  return plot;
}

TEST(Plot, IsWellFormedAndNamed) {
  const std::string svg = sample().svg();
  EXPECT_EQ(tag_fault(svg), "");
  EXPECT_EQ(attributes(svg, "aria-label").at(0), "A &quot;plot&quot; &lt;of&gt; things");
  EXPECT_EQ(svg.find("nan"), std::string::npos);
  EXPECT_EQ(svg, sample().svg());
}

TEST(Plot, ValuesBeyondTheAxesStayInside) {
  Plot plot = sample();
  plot.series[0].points = {{1, 9}, {1e12, -1}};
  for (const std::string& d : attributes(plot.svg(), "d")) EXPECT_EQ(d.find("inf"), std::string::npos) << d;
}

TEST(Plot, TheLegendOfDotsIsADot) {
  Plot plot = sample();
  plot.series = {{"dots", "c", {{1000, 0.2}, {1e6, 0.1}}, false, false, true}};
  const std::string svg = plot.svg();
  std::size_t dots = 0;
  for (std::size_t at = 0; (at = svg.find("<circle class=\"fc\"", at)) != std::string::npos; ++at) ++dots;
  EXPECT_EQ(dots, 3u) << "two values and the legend's: " << svg;
  EXPECT_EQ(svg.find("class=\"line c"), std::string::npos) << "no line stands for them";
}

TEST(Plot, AnEmptyPlotHasAxes) {
  Plot plot;
  plot.y_high = 0;
  EXPECT_EQ(tag_fault(plot.svg()), "");
  EXPECT_EQ(plot.svg().find("nan"), std::string::npos);
}

TEST(Plot, ALinearAxisMayGoBelowZero) {
  Plot plot;
  plot.x_name = "samples";
  plot.x_low = 0, plot.x_high = 100, plot.y_low = -1, plot.y_high = 3, plot.linear_x = true;
  plot.series.push_back({"line", "a", {{0, -1}, {50, 0}, {100, 3}}, false, false, false, false});
  const std::string svg = plot.svg();
  EXPECT_EQ(tag_fault(svg), "");
  for (const char* label : {">-1</text>", ">3</text>", ">0</text>", ">50</text>", ">100</text>"})
    EXPECT_NE(svg.find(label), std::string::npos) << label;
  EXPECT_EQ(svg.find(">-0</text>"), std::string::npos);
  // 760 px wide with 58 and 16 left free: 50 of 100 lies at 58 + 686 / 2 = 401; 0 of -1..3 at 30 + 280 * 3 /
  // 4 = 240.
  EXPECT_NE(svg.find("M58.0 310.0L401.0 240.0L744.0 30.0"), std::string::npos) << svg;
}

}  // namespace texmesh::testing::plot_test
