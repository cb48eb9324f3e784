#include "lab/psychometrics/psychometrics.h"

#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

#include "format/rules/split_mix.h"

namespace texmesh::threshold_study_test {

const std::vector<double> kSizes{64, 128, 256};
const RunContext kOneThread{1, {}, nullptr}, kEightThreads{8, {}, nullptr};

/// Judges whose thresholds scatter around jnd (128 / D)^exponent.
std::vector<JudgeTable> judges_of(double jnd, double exponent, std::size_t count, std::uint32_t answers,
                                  std::uint64_t seed, double scatter = 0.1) {
  SplitMix random(seed);
  std::vector<JudgeTable> out(count);
  for (JudgeTable& judge : out) {
    const double own = std::exp(scatter * (random.next() + random.next() - 1) * 2.4);
    for (const double px : kSizes) {
      const Psychometric curve{own * jnd * std::pow(128 / px, exponent), 4, 0.02};
      std::vector<LevelCount> counts;
      for (double level = 0.01; level < 0.45; level *= 1.5) {
        LevelCount c{level, answers, 0};
        for (std::uint32_t k = 0; k < answers; ++k) c.right += random.next() < curve.share_right(level);
        counts.push_back(c);
      }
      judge.conditions.push_back(counts);
    }
  }
  return out;
}

TEST(ThresholdStudy, TellsJudgesOfEveryDistanceFromThoseOfTheAngle) {
  const ThresholdStudy printed = study_thresholds(judges_of(0.1, 0, 12, 12, 1), kSizes, 200, 7, kOneThread),
                       inverse = study_thresholds(judges_of(0.1, 1, 12, 12, 2), kSizes, 200, 7, kOneThread);
  EXPECT_NEAR(printed.law.jnd.value, 0.1, 0.01);
  EXPECT_NEAR(inverse.law.jnd.value, 0.1, 0.01);
  EXPECT_NEAR(printed.law.reference_px, 128, 1e-9);
  EXPECT_TRUE(printed.law.may_be_printed());
  EXPECT_FALSE(printed.law.may_be_inverse());
  EXPECT_FALSE(inverse.law.may_be_printed());
  EXPECT_TRUE(inverse.law.may_be_inverse());
  EXPECT_TRUE(printed.within && inverse.within);
  EXPECT_NEAR(inverse.conditions[0].threshold.value / inverse.conditions[2].threshold.value, 4, 0.5);
}

TEST(ThresholdStudy, FewAnswersDecideNothing) {
  const ThresholdStudy study =
      study_thresholds(judges_of(0.1, 0.5, 2, 4, 3), {120, 128, 137}, 200, 7, kOneThread);
  EXPECT_TRUE(study.law.may_be_printed());
  EXPECT_TRUE(study.law.may_be_inverse());
}

TEST(ThresholdStudy, BoundsHoldTheTruthAboutAsOftenAsTheySay) {
  for (const std::size_t judges : {3u, 12u}) {
    int held = 0, runs = 40;
    for (int run = 0; run < runs; ++run) {
      const ThresholdStudy study =
          study_thresholds(judges_of(0.1, 0, judges, 6, 100 + static_cast<std::uint64_t>(run),
                                     judges >= kLeastJudgesToDraw ? 0.2 : 0),
                           kSizes, 60, 7, kOneThread);
      EXPECT_EQ(study.by_judges, judges >= kLeastJudgesToDraw);
      held += study.pooled.threshold.low <= 0.1 && study.pooled.threshold.high >= 0.1;
    }
    EXPECT_GE(held, 33) << judges;
  }
}

TEST(ThresholdStudy, MoreAnswersMeanNarrowerBounds) {
  const auto width = [](std::uint32_t answers) {
    const ThresholdStudy s = study_thresholds(judges_of(0.1, 0, 2, answers, 9), kSizes, 200, 7, kOneThread);
    return s.pooled.threshold.high - s.pooled.threshold.low;
  };
  EXPECT_LT(width(80), 0.6 * width(8));
}

TEST(ThresholdStudy, SameSeedSameBitsForAnyThreads) {
  const std::vector<JudgeTable> judges = judges_of(0.1, 0.3, 6, 6, 4);
  const ThresholdStudy one = study_thresholds(judges, kSizes, 100, 7, kOneThread),
                       many = study_thresholds(judges, kSizes, 100, 7, kEightThreads),
                       other = study_thresholds(judges, kSizes, 100, 8, kOneThread);
  const auto numbers = [](const ThresholdStudy& s) {
    std::vector<double> out{s.law.jnd.low, s.law.jnd.high, s.law.exponent.low, s.law.exponent.high};
    for (const ConditionFit& c : s.conditions)
      out.insert(out.end(), {c.threshold.value, c.threshold.low, c.threshold.high});
    return out;
  };
  EXPECT_EQ(numbers(one), numbers(many));
  EXPECT_NE(numbers(one), numbers(other));
  EXPECT_EQ(one.law.jnd.value, other.law.jnd.value);  // chance is for the bounds alone
}

TEST(ThresholdStudy, OneSizeKnowsNoDistance) {
  std::vector<JudgeTable> judges = judges_of(0.1, 0, 3, 20, 4);
  for (JudgeTable& j : judges) j.conditions.resize(1);
  const ThresholdStudy study = study_thresholds(judges, {256}, 100, 7, kOneThread);
  EXPECT_EQ(study.law.exponent.value, 0);
  EXPECT_EQ(study.law.exponent.high, 0);
  EXPECT_NEAR(study.law.jnd.value, study.conditions[0].threshold.value, 1e-12);
}

TEST(ThresholdStudy, Refuses) {
  const std::vector<JudgeTable> judges = judges_of(0.1, 0, 2, 6, 4);
  EXPECT_THROW(study_thresholds(judges, {64}, 100, 7, kOneThread), std::invalid_argument);
  EXPECT_THROW(study_thresholds(judges, {64, 128, 0}, 100, 7, kOneThread), std::invalid_argument);
  EXPECT_THROW(study_thresholds(judges, kSizes, 10, 7, kOneThread), std::invalid_argument);
  EXPECT_THROW(study_thresholds({}, kSizes, 100, 7, kOneThread), std::invalid_argument);
}

}  // namespace texmesh::threshold_study_test
