#include "pipeline/io/names/closest_word.h"

#include <gtest/gtest.h>

namespace texmesh::closest_word_test {

constexpr std::string_view kWords[] = {"compile", "dump", "CC-BY-4.0", "CC0-1.0", "--title", "x"};

std::string_view closest(std::string_view written) { return closest_word(written, kWords); }

TEST(ClosestWord, FindsWhatHasFewOtherLetters) {
  EXPECT_EQ(closest("complie"), "compile") << "two letters changed places";
  EXPECT_EQ(closest("compil"), "compile");
  EXPECT_EQ(closest("compille"), "compile");
  EXPECT_EQ(closest("Compile"), "compile");
  EXPECT_EQ(closest("CC BY 4.0"), "CC-BY-4.0");
  EXPECT_EQ(closest("cc0 1.0"), "CC0-1.0");
  EXPECT_EQ(closest("--tilte"), "--title");
  EXPECT_EQ(closest("com"), "compile") << "its beginning";
}

TEST(ClosestWord, FindsNothingInOtherWords) {
  for (const char* word : {"", "-", "y", "report", "zip", "du", "compilation of scans"})
    EXPECT_EQ(closest(word), "") << word;
  EXPECT_EQ(closest_word("dump", {}), "");
  EXPECT_EQ(closest(std::string(1 << 20, 'c')), "") << "in little time";
}

TEST(ClosestWord, TheSuggestionIsASentenceOrNothing) {
  EXPECT_EQ(meant_instead("dupm", kWords), "; did you mean dump?");
  EXPECT_EQ(meant_instead("report", kWords), "");
}

}  // namespace texmesh::closest_word_test
