#include "tools/cli/options/common_options.h"

#include <gtest/gtest.h>

#include <sstream>

namespace texmesh {
namespace {

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

TEST(PercentLine, NothingStandsInALog) {
  std::ostringstream out;
  PercentLine line("extract", out, false);
  line.show(0.5);
  line.end();
  EXPECT_EQ(out.str(), "");
}

}  // namespace
}  // namespace texmesh
