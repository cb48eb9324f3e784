#include "lab/psychometrics/psychometrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "format/rules/split_mix.h"

namespace texmesh::psychometric_test {

using Counts = std::vector<LevelCount>;

/// The answers that a judge with that curve gives in the mean, at ten levels.
Counts expected_counts(const Psychometric& judge, std::uint32_t answers, double largest) {
  Counts out;
  for (int k = 1; k <= 10; ++k) {
    const double level = largest * k / 10;
    out.push_back(
        {level, answers, static_cast<std::uint32_t>(std::lround(answers * judge.share_right(level)))});
  }
  return out;
}

Counts drawn_counts(const Psychometric& judge, std::uint32_t answers, double largest, SplitMix& random) {
  Counts out = expected_counts(judge, answers, largest);
  for (LevelCount& c : out) {
    c.right = 0;
    for (std::uint32_t k = 0; k < answers; ++k) c.right += random.next() < judge.share_right(c.level);
  }
  return out;
}

TEST(Psychometric, TheThresholdHasThreeQuartersRightWhateverTheRest) {
  for (const double lapse : {0.0, 0.03, 0.06})
    for (const double slope : {0.5, 3.0, 20.0}) {
      const Psychometric p{0.07, slope, lapse};
      EXPECT_NEAR(p.share_right(0.07), 0.75, 1e-12);
      EXPECT_EQ(p.share_right(0), 0.5);
      EXPECT_NEAR(p.share_right(1e6), 1 - lapse, 1e-3);
      EXPECT_LT(p.share_right(0.069), p.share_right(0.071));
    }
}

TEST(Psychometric, FindsTheCurveOfExpectedAnswers) {
  for (const double threshold : {0.04, 0.10, 0.16})
    for (const double slope : {1.5, 3.0, 8.0})
      for (const double lapse : {0.0, 0.04}) {
        const Psychometric judge{threshold, slope, lapse};
        const PsychometricFit fit = fit_psychometric(expected_counts(judge, 100000, 0.2));
        EXPECT_NEAR(fit.curve.threshold / threshold, 1, 0.003) << threshold << ' ' << slope << ' ' << lapse;
        EXPECT_NEAR(fit.curve.slope / slope, 1, 0.02) << threshold << ' ' << slope << ' ' << lapse;
        EXPECT_NEAR(fit.curve.lapse, lapse, 0.005) << threshold << ' ' << slope << ' ' << lapse;
        EXPECT_TRUE(fit.within);
        EXPECT_LT(fit.deviance, 2);  // answers are whole: a tenth of a wrong one is none
      }
}

TEST(Psychometric, DrawnAnswersLeaveNoBias) {
  SplitMix random(5);
  const Psychometric judge{0.1, 3, 0.02};
  double log_sum = 0, deviance = 0;
  constexpr int kRuns = 200;
  for (int run = 0; run < kRuns; ++run) {
    const PsychometricFit fit = fit_psychometric(drawn_counts(judge, 60, 0.2, random));
    log_sum += std::log(fit.curve.threshold / 0.1);
    deviance += fit.deviance;
  }
  EXPECT_NEAR(log_sum / kRuns, 0, 0.015);
  EXPECT_NEAR(deviance / kRuns, 10 - 3, 1.5);  // levels less parameters
}

TEST(Psychometric, SaysWhenTheThresholdIsOutside) {
  Counts seen = expected_counts({0.1, 3, 0}, 100, 0.2), guessed = seen;
  for (LevelCount& c : seen) c.right = c.answers;
  for (LevelCount& c : guessed) c.right = c.answers / 2;
  const PsychometricFit all = fit_psychometric(seen), none = fit_psychometric(guessed);
  EXPECT_FALSE(all.within);
  EXPECT_LT(all.curve.threshold, 0.02);
  EXPECT_FALSE(none.within);
  EXPECT_GT(none.curve.threshold, 0.2);
  EXPECT_LE(none.curve.threshold, 0.8 * 1.0001);
}

TEST(Psychometric, OrderAndPartsOfCountsDoNotMatter) {
  const Counts counts = expected_counts({0.08, 4, 0.01}, 40, 0.2);
  Counts parts;
  for (auto c = counts.rbegin(); c != counts.rend(); ++c) {
    parts.push_back({c->level, 15, std::min(c->right, 15u)});
    parts.push_back({c->level, c->answers - 15, c->right - std::min(c->right, 15u)});
  }
  parts.push_back({0.5, 0, 0});  // nobody was asked
  const PsychometricFit whole = fit_psychometric(counts), split = fit_psychometric(parts);
  EXPECT_EQ(whole.curve.threshold, split.curve.threshold);
  EXPECT_EQ(whole.deviance, split.deviance);
  EXPECT_DOUBLE_EQ(fit_line(counts).threshold, fit_line(parts).threshold);
}

TEST(Psychometric, RefusesWhatIsNoCount) {
  EXPECT_THROW(fit_psychometric(Counts{}), std::invalid_argument);
  EXPECT_THROW(fit_psychometric(Counts{{0.1, 0, 0}}), std::invalid_argument);
  EXPECT_THROW(fit_psychometric(Counts{{0, 3, 1}}), std::invalid_argument);
  EXPECT_THROW(fit_psychometric(Counts{{-0.1, 3, 1}}), std::invalid_argument);
  EXPECT_THROW(fit_psychometric(Counts{{std::nan(""), 3, 1}}), std::invalid_argument);
  EXPECT_THROW(fit_psychometric(Counts{{0.1, 3, 4}}), std::invalid_argument);
  EXPECT_THROW(fit_line(Counts{{0.1, 3, 4}}), std::invalid_argument);
}

TEST(Psychometric, TheLineIsThatOfThePrintedFigure) {
  // Shares from 50 % at 0 to 75 % at 0.10.
  Counts counts;
  for (int k = 1; k <= 20; ++k) counts.push_back({0.01 * k, 1000, static_cast<std::uint32_t>(500 + 25 * k)});
  const LineFit fit = fit_line(counts);
  EXPECT_NEAR(fit.threshold, 0.10, 1e-9);
  EXPECT_NEAR(fit.intercept, 0.5, 1e-9);
  EXPECT_NEAR(fit.slope, 2.5, 1e-9);
  EXPECT_TRUE(std::isnan(fit_line(Counts{{0.1, 10, 5}, {0.2, 10, 5}}).threshold));
  EXPECT_TRUE(std::isnan(fit_line(Counts{{0.1, 10, 9}}).threshold));  // one level makes no line
}

}  // namespace texmesh::psychometric_test
