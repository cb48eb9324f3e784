#include "pipeline/import/text_scan.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

namespace texmesh::text_scan_test {

TEST(TextScan, Numbers) {
  double x = 0;
  for (const auto& [text, value] : {std::pair{"1", 1.0},
                                    {"-2.5e3", -2500.0},
                                    {"+.5", 0.5},
                                    {"1.", 1.0},
                                    {"1e999", HUGE_VAL},
                                    {"-1e999", -HUGE_VAL},
                                    {"1e-999", 0.0},
                                    {"inf", HUGE_VAL},
                                    {"-Infinity", -HUGE_VAL},
                                    {"0.1", 0.1}}) {
    EXPECT_TRUE(parse_number(text, x)) << text;
    EXPECT_EQ(x, value) << text;
  }
  for (const char* text : {"nan", "-NaN", "nan(ind)", "-1.#IND", "1.#QNAN00"}) {
    EXPECT_TRUE(parse_number(text, x)) << text;
    EXPECT_TRUE(std::isnan(x)) << text;
  }
  for (const char* text : {"", "-", "+-1", "--1", "x", "1x", "1,5", "0x10", "1 2", "1.#"})
    EXPECT_FALSE(parse_number(text, x)) << text;
}

TEST(TextScan, NotesOfOneKindEnd) {
  Notes notes;
  for (int repeat = 0; repeat < 2; ++repeat)
    for (std::size_t i = 0; i < 2 * kMostNotesOfCode; ++i)
      add_once(notes, Severity::kWarning, "missing-texture", "", std::to_string(i));
  add_once(notes, Severity::kWarning, "other", "", "0");
  ASSERT_EQ(notes.size(), kMostNotesOfCode + 2);
  EXPECT_EQ(notes[kMostNotesOfCode - 1].text, std::to_string(kMostNotesOfCode - 1));
  EXPECT_EQ(notes[kMostNotesOfCode].text, "there are more of these, which are left out");
}

}  // namespace texmesh::text_scan_test
