#include <gtest/gtest.h>

#include <cmath>

#include "lab/thesis/exhibits.h"
#include "tests/lab/thesis/exhibit_rows.h"

namespace texmesh::transfer_exhibits_test {

using namespace testing;  // NOLINT: fixtures

const std::vector<Exhibit>& transfers() {
  static const std::vector<Exhibit> kMade = transfer_exhibits({});
  return kMade;
}

TEST(TransferExhibits, AreSound) { expect_sound(transfers()); }

TEST(TransferExhibits, Table41HasThePrintedAverages) {
  const Exhibit& e = exhibit_of(transfers(), "4.1");
  const double printed[] = {41.68, 45.64, 42.07};
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_EQ(number_at(e, 0, k, 1), printed[k]);
    EXPECT_NEAR(number_at(e, 0, k, 2) / printed[k], 1, 0.04);
  }
}

TEST(TransferExhibits, Table42HasTwelveRowsWithLimitsWorkedByHand) {
  const Exhibit& e = exhibit_of(transfers(), "4.2");
  ASSERT_EQ(e.tables[0].rows.size(), 12u);
  for (std::size_t k = 0; k < 12; ++k) {
    const double beta0 = 20 + 3.0 * static_cast<double>(k);
    EXPECT_NEAR(number_at(e, 0, k, 2), 418 / beta0, 1e-9);
    EXPECT_NEAR(number_at(e, 0, k, 1), 418 / beta0, 0.011) << "printed with two digits";
    EXPECT_NEAR(number_at(e, 0, k, 4), 100 * (1 - beta0 / 41.68), 1e-9);
    EXPECT_NEAR(number_at(e, 0, k, 3), 100 * (1 - beta0 / 41.68), 0.8) << "rows 20 to 29 and 53, too";
  }
  EXPECT_NEAR(number_at(e, 0, 0, 4), 52.015, 0.001);  // 1 - 20 / 41.68
}

TEST(TransferExhibits, Table42OrderOfTheCreditHoldsAndThePrintedOrderFails) {
  const Exhibit& e = exhibit_of(transfers(), "4.2");
  // The second table: beta_0, printed, then mean and largest of credit 26, printed order 26, credit 10,
  // printed 10, credit 26 by time.
  for (std::size_t k = 0; k < 12; ++k) {
    EXPECT_LT(number_at(e, 1, k, 2), 0.2) << k;
    EXPECT_LE(number_at(e, 1, k, 2), number_at(e, 1, k, 3)) << "mean and largest";
    EXPECT_LE(std::abs(number_at(e, 0, k, 6)), number_at(e, 1, k, 2) + 1e-12)
        << "the signed mean is no larger";
  }
  EXPECT_NEAR(number_at(e, 1, 0, 4), 10.8, 0.1);  // the rows that the printed order misses
  EXPECT_NEAR(number_at(e, 1, 1, 4), 8.5, 0.1);
  EXPECT_NEAR(number_at(e, 1, 2, 4), 4.7, 0.1);
  for (std::size_t k = 3; k < 12; ++k) EXPECT_LT(number_at(e, 1, k, 4), 1) << "29 to 53";
  EXPECT_NEAR(number_at(e, 1, 0, 10), 4.3, 0.05) << "over traces by time";
  EXPECT_NEAR(number_at(e, 1, 0, 11), 7.3, 0.05);
  EXPECT_EQ(e.verdict, Verdict::kInPart);
  EXPECT_NE(e.finding.find("beta_0 = 20, 23, 26"), std::string::npos) << e.finding;
}

TEST(TransferExhibits, Fig45QualityFollowsTheLinkWithinItsLimits) {
  const Exhibit& e = exhibit_of(transfers(), "fig-4.5");
  ASSERT_EQ(e.tables[0].rows.size(), 3u);
  for (std::size_t column = 2; column < 5; ++column) EXPECT_EQ(number_at(e, 0, 0, column), 80);
  const double estimated_kb = number_at(e, 0, 0, 1), beta0[] = {0, 32, 50};
  for (std::size_t row = 1; row < 3; ++row) {
    EXPECT_GE(number_at(e, 0, row, 3), 40);
    EXPECT_LE(number_at(e, 0, row, 4), 100);
    EXPECT_LT(std::abs(number_at(e, 0, row, 6)), 1) << "in time";
    // The link carries 41.68 KB/s in the mean, so bytes go by that over beta_0.
    EXPECT_NEAR(number_at(e, 0, row, 1) / estimated_kb, 41.68 / beta0[row], 0.05);
  }
  EXPECT_GT(number_at(e, 0, 1, 2), 80);
  EXPECT_LT(number_at(e, 0, 2, 2), 80);
  EXPECT_GT(number_at(e, 0, 1, 5), number_at(e, 0, 0, 5));
  EXPECT_LT(number_at(e, 0, 2, 5), number_at(e, 0, 0, 5));
}

TEST(TransferExhibits, NetworksAreJudgedByTheirRuns) {
  for (const char* id : {"fig-4.6", "fig-4.7"}) {
    const Exhibit& e = exhibit_of(transfers(), id);
    EXPECT_EQ(e.tables[0].columns.size(), 10u);
    EXPECT_EQ(e.plots[0].series.size(), e.tables[0].rows.size());
    std::size_t beyond = 0;
    for (std::size_t row = 0; row < e.tables[0].rows.size(); ++row)
      for (std::size_t k = 1; k < 10; ++k) beyond += std::abs(number_at(e, 0, row, k)) >= 1;
    EXPECT_EQ(e.verdict == Verdict::kConfirmed, beyond == 0) << e.finding;
    EXPECT_NE(e.finding.find(std::to_string(beyond) + " of "), std::string::npos) << e.finding;
    for (std::size_t row = 0; row < e.tables[0].rows.size(); ++row)
      EXPECT_LT(std::abs(number_at(e, 0, row, 6)), 1.2) << "at the average itself";
  }
}

}  // namespace texmesh::transfer_exhibits_test
