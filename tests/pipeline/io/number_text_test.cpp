#include "pipeline/io/number_text.h"

#include <gtest/gtest.h>

namespace texmesh {
namespace {

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
}

TEST(NumberText, BytesHaveAtMostThreeDigits) {
  EXPECT_EQ(format_bytes(0), "0 B");
  EXPECT_EQ(format_bytes(12), "12 B");
  EXPECT_EQ(format_bytes(999), "999 B");
  EXPECT_EQ(format_bytes(1000), "1 kB");
  EXPECT_EQ(format_bytes(340'000), "340 kB");
  EXPECT_EQ(format_bytes(999'600), "1 MB");
  EXPECT_EQ(format_bytes(1'234'560), "1.23 MB");
  EXPECT_EQ(format_bytes(45'600'000'000), "45.6 GB");
  EXPECT_EQ(format_bytes(7'000'000'000'000), "7 TB");
  EXPECT_EQ(kilobytes(1234), "1.2");
}

TEST(NumberText, PagesHaveNarrowBlanks) {
  EXPECT_EQ(thin_grouped(1234567),
            "1\xe2\x80\xaf"
            "234\xe2\x80\xaf"
            "567");
  EXPECT_EQ(thin_grouped(12), "12");
}

TEST(NumberText, SecondsBecomeMinutesAndHours) {
  EXPECT_EQ(format_seconds(3.42), "3.4 s");
  EXPECT_EQ(format_seconds(130), "2 min 10 s");
  EXPECT_EQ(format_seconds(3900), "1 h 5 min");
}

}  // namespace
}  // namespace texmesh
