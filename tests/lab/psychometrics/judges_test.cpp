#include "lab/psychometrics/psychometrics.h"

#include <gtest/gtest.h>

namespace texmesh::judges_test {

TEST(Judges, BinomialTails) {
  EXPECT_DOUBLE_EQ(binomial_at_most(0, 3, 0.5), 0.125);
  EXPECT_DOUBLE_EQ(binomial_at_most(1, 3, 0.5), 0.5);
  EXPECT_DOUBLE_EQ(binomial_at_most(3, 3, 0.5), 1);
  EXPECT_NEAR(binomial_at_most(6, 10, 0.9), 0.0127951984, 1e-9);
  EXPECT_NEAR(binomial_at_most(2000, 4000, 0.5), 0.5063, 1e-4);
}

TEST(Judges, WhoLooksIsKept) {
  EXPECT_EQ(screen_judge({100, 52, 10, 10}), JudgeVerdict::kKept);
  EXPECT_EQ(screen_judge({100, 35, 10, 8}), JudgeVerdict::kKept);
  EXPECT_EQ(screen_judge({20, 10, 4, 4}), JudgeVerdict::kKept);
}

TEST(Judges, OneKey) {
  EXPECT_EQ(screen_judge({100, 100, 10, 5}), JudgeVerdict::kOneSide);
  EXPECT_EQ(screen_judge({100, 0, 10, 5}), JudgeVerdict::kOneSide);
  EXPECT_EQ(screen_judge({100, 92, 10, 10}), JudgeVerdict::kOneSide);
  EXPECT_EQ(screen_judge({20, 20, 4, 2}), JudgeVerdict::kOneSide);
}

TEST(Judges, CatchTrials) {
  EXPECT_EQ(screen_judge({100, 50, 10, 6}), JudgeVerdict::kInattentive);
  EXPECT_EQ(screen_judge({100, 50, 10, 7}), JudgeVerdict::kKept);  // once in fourteen for a good judge
  EXPECT_EQ(screen_judge({100, 50, 4, 1}), JudgeVerdict::kInattentive);
}

TEST(Judges, TooFew) {
  EXPECT_EQ(screen_judge({3, 2, 1, 1}), JudgeVerdict::kTooFew);
  EXPECT_EQ(screen_judge({19, 9, 4, 4}), JudgeVerdict::kTooFew);
  EXPECT_EQ(screen_judge({100, 50, 3, 3}), JudgeVerdict::kTooFew);
  EXPECT_EQ(screen_judge({0, 0, 0, 0}), JudgeVerdict::kTooFew);
}

}  // namespace texmesh::judges_test
