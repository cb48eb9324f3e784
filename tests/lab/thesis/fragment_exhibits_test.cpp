#include <gtest/gtest.h>

#include "lab/thesis/exhibits.h"
#include "tests/lab/thesis/exhibit_rows.h"

namespace texmesh::fragment_exhibits_test {

using namespace testing;  // NOLINT: fixtures

TEST(FragmentExhibits, TablesOfSizes) {
  const std::vector<Exhibit> made = fragment_exhibits({});
  expect_sound(made);
  const Exhibit& e = exhibit_of(made, "3.1");
  ASSERT_EQ(e.tables[0].rows.size(), 13u);
  EXPECT_NEAR(number_at(e, 0, 0, 8), 0.5177, 1e-4);  // 293 of 566 KB
  EXPECT_NEAR(number_at(e, 0, 1, 8), 1.5172, 1e-4);  // 44 of 29 KB
  for (std::size_t k = 0; k < 13; ++k) {
    EXPECT_NEAR(number_at(e, 0, k, 9), number_at(e, 0, k, 6) / number_at(e, 0, k, 4), 1e-9);
    const double side = number_at(e, 0, k, 1), fragments = side * side / 256;
    EXPECT_GT(number_at(e, 0, k, 6), 0.6 * fragments) << "a complete JPEG has 0.6 kB of headers";
  }
  EXPECT_EQ(e.verdict, Verdict::kNotConfirmed);
  const Exhibit& cut = exhibit_of(made, "fig-3.5");
  std::size_t rows_of_one = 0;
  for (std::size_t k = 0; k < cut.tables[0].rows.size(); ++k)
    if (number_at(cut, 0, k, 1) == 1) {
      ++rows_of_one;
      EXPECT_EQ(number_at(cut, 0, k, 5), 1) << "one fragment is the file";
    }
  EXPECT_EQ(rows_of_one, 5u);
  const auto& rows = cut.tables[0].rows;
  EXPECT_EQ(rows.size(), 5u * (5 + 6));
  EXPECT_EQ(std::get<std::string>(rows.back()[0].value), "4096");
  for (std::size_t k = 0; k < rows.size(); ++k)
    if (number_at(cut, 0, k, 2) >= 128) EXPECT_LT(number_at(cut, 0, k, 6), 1) << "shared tables, row " << k;
  for (std::size_t k = 0; k < rows.size(); ++k)
    for (std::size_t other = 0; other < k; ++other)
      EXPECT_FALSE(rows[k][0].value == rows[other][0].value &&
                   number_at(cut, 0, k, 1) == number_at(cut, 0, other, 1) &&
                   number_at(cut, 0, k, 3) == number_at(cut, 0, other, 3))
          << "a row stands there twice: " << k;
}

}  // namespace texmesh::fragment_exhibits_test
