#include "tools/cli/options/common_options.h"

#include <gtest/gtest.h>

#include <sstream>

namespace texmesh::percent_line_test {

TEST(PercentLine, RisesAndIsTakenAway) {
  std::ostringstream out;
  {
    PercentLine line("extract", out, true);
    for (const double fraction : {0.0, 0.4, 0.2, 0.4, 7.0}) line.show(fraction);
    EXPECT_EQ(out.str(), "\r\033[Kextract 0 %\r\033[Kextract 40 %\r\033[Kextract 100 %");
    line.end();
    line.show(1);
  }
  EXPECT_EQ(out.str(), "\r\033[Kextract 0 %\r\033[Kextract 40 %\r\033[Kextract 100 %\r\033[K");
}

TEST(PercentLine, SecondsStandThereWhileNobodySaysHowFarItIs) {
  std::ostringstream out;
  PercentLine line("report", out, true, std::chrono::milliseconds(1));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  line.end();
  const std::string drawn = out.str();
  EXPECT_TRUE(drawn.starts_with("\r\033[Kreport 0 s")) << drawn;
  EXPECT_TRUE(drawn.ends_with("\r\033[K")) << drawn;
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  EXPECT_EQ(out.str(), drawn) << "it has ended";
}

TEST(PercentLine, TellsTheTimeThatIsLeftWhereItTakesLong) {
  std::ostringstream out;
  PercentLine line("extract", out, true, std::chrono::milliseconds(1));
  line.show(0);
  std::this_thread::sleep_for(std::chrono::milliseconds(20));
  line.show(0.5);
  EXPECT_TRUE(out.str().ends_with("extract 50 %, 1 s left")) << out.str();
}

TEST(PercentLine, NothingStandsInALog) {
  std::ostringstream out;
  PercentLine line("extract", out, false);
  line.show(0.5);
  line.end();
  EXPECT_EQ(out.str(), "");
}

}  // namespace texmesh::percent_line_test
