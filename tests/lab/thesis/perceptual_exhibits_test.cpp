#include <gtest/gtest.h>

#include <cmath>

#include "lab/thesis/exhibits.h"
#include "tests/lab/thesis/exhibit_rows.h"

namespace texmesh::perceptual_exhibits_test {

using namespace testing;  // NOLINT: fixtures

const std::vector<Exhibit>& perceptions() {
  static const std::vector<Exhibit> kMade = perceptual_exhibits({});
  return kMade;
}

TEST(PerceptualExhibits, AreSound) { expect_sound(perceptions()); }

TEST(PerceptualExhibits, Table71HasPrintedAndMeasuredSteps) {
  const Exhibit& e = exhibit_of(perceptions(), "7.1");
  ASSERT_EQ(e.tables[0].rows.size(), 5u);
  EXPECT_NE(e.made_by.find("1260 faces"), std::string::npos) << e.made_by;
  double faces = 1260;
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_LT(number_at(e, 0, k, 3), faces) << "fewer faces at every scale";
    faces = number_at(e, 0, k, 3);
    EXPECT_LE(number_at(e, 0, k, 9), number_at(e, 0, k, 5)) << "least";
    EXPECT_GE(number_at(e, 0, k, 8), number_at(e, 0, k, 5)) << "largest";
    EXPECT_GT(number_at(e, 0, k, 10), 0) << "by the quadric error";
    EXPECT_LT(number_at(e, 0, k, 10), 0.5);
  }
  EXPECT_EQ(number_at(e, 0, 3, 4), 0.0468);
}

/// The rules stand in made_by, before the numbers.
TEST(PerceptualExhibits, VerdictsFollowTheirRules) {
  const std::vector<Exhibit> scales = scale_exhibits({});
  const Exhibit &steps = exhibit_of(perceptions(), "7.1"), &head = exhibit_of(scales, "2.1");
  int rising = 0, beyond = 0;
  for (std::size_t k = 0; k < 5; ++k) {
    rising += k > 0 && number_at(steps, 0, k, 5) >= number_at(steps, 0, k - 1, 5);
    beyond += number_at(steps, 0, k, 5) >= 0.1;
  }
  EXPECT_EQ(steps.verdict == Verdict::kNotConfirmed, beyond > 0 || rising < 2) << steps.finding;
  double furthest = 0;
  for (std::size_t k = 0; k < head.tables[0].rows.size(); ++k)
    furthest = std::max(furthest, std::abs(number_at(head, 0, k, 3) - number_at(head, 0, k, 4)));
  EXPECT_EQ(head.verdict == Verdict::kNotConfirmed, furthest > 25) << head.finding;
}

TEST(PerceptualExhibits, Table72RulesWorkedByHand) {
  const Exhibit& e = exhibit_of(perceptions(), "7.2");
  // From Table 7.1: sqrt(.0410^2 + .0412^2) = .0581; .0410 + .0412 = .0822; over all five .1116 and .2446.
  EXPECT_NEAR(number_at(e, 0, 1, 2), 0.0581244, 1e-6);
  EXPECT_NEAR(number_at(e, 0, 1, 3), 0.0822, 1e-9);
  EXPECT_NEAR(number_at(e, 0, 4, 2), 0.11158, 1e-5);
  EXPECT_NEAR(number_at(e, 0, 4, 3), 0.2446, 1e-9);
  EXPECT_EQ(number_at(e, 0, 3, 1), 0.0759);
  EXPECT_NE(e.finding.find("first major scale is S_4, as printed"), std::string::npos) << e.finding;
  for (std::size_t k = 1; k < 5; ++k)
    EXPECT_GE(number_at(e, 0, k, 5), number_at(e, 0, k - 1, 5)) << "roots grow";
}

TEST(PerceptualExhibits, Table73GeometryOfTheMonitors) {
  const Exhibit& e = exhibit_of(perceptions(), "7.3");
  ASSERT_EQ(e.tables[0].rows.size(), 4u);
  EXPECT_NEAR(number_at(e, 0, 0, 3), 1024 / 12.0, 1e-9);
  EXPECT_NEAR(number_at(e, 0, 1, 3), 96, 1e-9);
  // 18 in * 96 px / in * 2 tan(.5 degrees) = 1728 * .0174536
  EXPECT_NEAR(number_at(e, 0, 1, 4), 30.16, 0.01);
  for (std::size_t k = 0; k < 4; ++k) {
    EXPECT_NEAR(number_at(e, 0, k, 5) / number_at(e, 0, k, 4), 30 / 18.0, 1e-9);
    EXPECT_GT(number_at(e, 0, k, 6), 5) << "a tenth of a radius on a screen of 768 px and more";
  }
}

TEST(PerceptualExhibits, AreTheSameForAnyThreads) {
  RunContext four;
  four.threads = 4;
  const std::vector<Exhibit> again = perceptual_exhibits(four);
  for (std::size_t k = 0; k < again.size(); ++k)
    EXPECT_EQ(exhibit_text(again[k]), exhibit_text(perceptions()[k]));
}

}  // namespace texmesh::perceptual_exhibits_test
