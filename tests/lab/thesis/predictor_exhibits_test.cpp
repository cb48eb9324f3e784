#include <gtest/gtest.h>

#include <cmath>

#include "lab/thesis/exhibits.h"
#include "lab/thesis/made_models.h"
#include "tests/lab/thesis/exhibit_rows.h"

namespace texmesh::predictor_exhibits_test {

using namespace testing;  // NOLINT: fixtures

const std::vector<Exhibit>& predictors_shown() {
  static const std::vector<Exhibit> kMade = predictor_exhibits({});
  return kMade;
}

TEST(PredictorExhibits, AreSound) { expect_sound(predictors_shown()); }

TEST(PredictorExhibits, Fig82FollowsTheFormulas) {
  const Exhibit& e = exhibit_of(predictors_shown(), "fig-8.2");
  ASSERT_EQ(e.tables[1].rows.size(), kMadePatterns);
  double least = 1, most = 0;
  for (std::size_t f = 0; f < kMadePatterns; ++f) {
    const double i = number_at(e, 1, f, 2), zeta = number_at(e, 1, f, 3), m = number_at(e, 1, f, 4);
    EXPECT_NEAR(m, 1 - (0.5 * (1 - i) + 0.5 * zeta), 1e-6);
    least = std::min(least, number_at(e, 1, f, 5)), most = std::max(most, number_at(e, 1, f, 5));
  }
  EXPECT_GE(least, 0);
  EXPECT_LE(most, 1);
  EXPECT_NEAR(number_at(e, 1, pattern_of('a'), 1), 0, 1e-6);  // plain: no deviation, no gradient
  EXPECT_NEAR(number_at(e, 1, pattern_of('a'), 2), 0.15, 0.005);
  EXPECT_EQ(number_at(e, 1, pattern_of('a'), 3), 0);
  std::vector<bool> holds;
  for (std::size_t k = 0; k < 9; ++k) {
    holds.push_back(number_at(e, 0, k, 1) > number_at(e, 0, k, 2));
    if (k < 6) EXPECT_TRUE(holds[k]) << "code draws for it: " << k;
  }
  const bool all = holds[6] && holds[7] && holds[8], none = !holds[6] && !holds[7] && !holds[8];
  EXPECT_EQ(e.verdict, all    ? Verdict::kConfirmed
                       : none ? Verdict::kNotConfirmed
                              : Verdict::kInPart)
      << exhibit_text(e);
}

TEST(PredictorExhibits, Fig83MarksWhatZetaCounts) {
  const Exhibit& e = exhibit_of(predictors_shown(), "fig-8.3");
  EXPECT_EQ(e.verdict, Verdict::kConfirmed) << exhibit_text(e);
  EXPECT_EQ(number_at(e, 0, pattern_of('a'), 2), 0);
  EXPECT_GT(number_at(e, 0, pattern_of('w'), 2), 0.2);
}

TEST(PredictorExhibits, Fig85SpendsTheSameBytes) {
  const Exhibit& e = exhibit_of(predictors_shown(), "fig-8.5");
  ASSERT_EQ(e.tables[0].rows.size(), 5u);
  const double uniform = number_at(e, 0, 4, 4), variable = number_at(e, 0, 4, 5);
  EXPECT_LE(variable, 1.01 * uniform);
  EXPECT_GE(variable, 0.9 * uniform);
  for (const std::size_t column : {4u, 5u}) {
    double sum = 0;
    for (std::size_t f = 0; f < 4; ++f) sum += number_at(e, 0, f, column);
    EXPECT_EQ(sum, number_at(e, 0, 4, column));
  }
  double least = 100, most = 0;
  for (std::size_t f = 0; f < 4; ++f) {
    least = std::min(least, number_at(e, 0, f, 3)), most = std::max(most, number_at(e, 0, f, 3));
  }
  EXPECT_NEAR(most - least, 18, 1) << "the printed span";
}

TEST(PredictorExhibits, Fig84BytesGrowWithQualityAndTheModelIsAnExponential) {
  const Exhibit& e = exhibit_of(predictors_shown(), "fig-8.4");
  EXPECT_EQ(number_at(e, 0, 0, 2), 825.45);
  double least = 1;
  for (std::size_t row = 1; row < 5; ++row) least = std::min(least, number_at(e, 0, row, 4));
  const double first = number_at(e, 0, 1, 4);
  EXPECT_EQ(e.verdict, least >= 0.95  ? Verdict::kConfirmed
                       : first >= 0.9 ? Verdict::kInPart
                                      : Verdict::kNotConfirmed);
  ASSERT_EQ(e.tables[1].rows.size(), 11u);
  for (std::size_t f = 0; f < 4; ++f)
    for (std::size_t row = 1; row < 11; ++row)
      EXPECT_GT(number_at(e, 1, row, 1 + 2 * f), number_at(e, 1, row - 1, 1 + 2 * f)) << row;
  // Steps of 10 in quality multiply the model's bytes by one and the same factor, (100 p)^(B / 10).
  const double factor = number_at(e, 1, 2, 2) / number_at(e, 1, 1, 2);
  EXPECT_NEAR(number_at(e, 1, 9, 2) / number_at(e, 1, 8, 2), factor, 1e-9);
  EXPECT_NEAR(std::log(factor), number_at(e, 0, 1, 3) * std::log(100 * number_at(e, 0, 1, 1)) / 10, 1e-6);
  EXPECT_EQ(e.plots[0].series.size(), 8u);
}

}  // namespace texmesh::predictor_exhibits_test
