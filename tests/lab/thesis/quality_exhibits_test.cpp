#include <gtest/gtest.h>

#include "lab/thesis/exhibits.h"
#include "tests/lab/thesis/exhibit_rows.h"

namespace texmesh::quality_exhibits_test {

using namespace testing;  // NOLINT: fixtures

TEST(QualityExhibits, Fig39ComparesEqualBytes) {
  const std::vector<Exhibit> made = quality_exhibits({});
  expect_sound(made);
  const Exhibit& e = exhibit_of(made, "fig-3.9");
  const std::size_t uniform = 0, variable = 1;
  EXPECT_EQ(std::get<std::string>(e.tables[0].rows[uniform][0].value), "uniform");
  EXPECT_EQ(std::get<std::string>(e.tables[0].rows[variable][0].value), "variable (3.2)");
  EXPECT_EQ(number_at(e, 0, uniform, 2), 11);
  EXPECT_EQ(number_at(e, 0, uniform, 3), 11);
  EXPECT_LE(number_at(e, 0, variable, 1), number_at(e, 0, uniform, 1));
  EXPECT_GT(number_at(e, 0, variable, 1), 0.9 * number_at(e, 0, uniform, 1));
  EXPECT_EQ(e.verdict == Verdict::kConfirmed, number_at(e, 0, variable, 5) > number_at(e, 0, uniform, 5));
  ASSERT_EQ(e.pictures.size(), 1u);
  EXPECT_EQ(e.pictures[0].width_px, 3 * e.pictures[0].height_px);
}

}  // namespace texmesh::quality_exhibits_test
