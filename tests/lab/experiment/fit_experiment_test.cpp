#include "lab/experiment/fit_experiment.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "format/base/errors.h"
#include "pipeline/compile/options.h"
#include "tests/lab/experiment/simulated_results.h"

namespace texmesh::fit_experiment_test {

using testing::simulated_design;
using testing::simulated_results;
using testing::SimulatedJudge;
using Habit = SimulatedJudge::Habit;

const RunContext kOneThread{1, {}, nullptr};

std::vector<ExperimentResults> group(const ExperimentDesign& design, const SimulatedJudge& judge,
                                     std::size_t count) {
  std::vector<ExperimentResults> out;
  for (std::size_t k = 0; k < count; ++k) out.push_back(simulated_results(design, judge, k));
  return out;
}

ExperimentFit fitted(const std::vector<ExperimentResults>& results, FitOptions options = {}) {
  options.draws = 100;
  return fit_experiment(results, std::nullopt, options, kOneThread);
}

std::string refused(const std::vector<ExperimentResults>& results, const std::optional<DesignKey>& key = {}) {
  FitOptions options;
  options.draws = 40;
  try {
    fit_experiment(results, key, options, kOneThread);
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

DesignKey key_of(const ExperimentDesign& design) {
  ExperimentDesign copy = design;
  const std::string text = write_design(copy);
  return read_design({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "design.json");
}

TEST(FitExperiment, KnownThresholdsComeBackWithinFivePercent) {
  const ExperimentDesign design = simulated_design({128}, 40);
  for (const double threshold : {0.06, 0.1, 0.15}) {
    SimulatedJudge judge;
    judge.threshold = threshold;
    // With lapses the share of 75 % lies a little above the curve's middle.
    const double wanted = threshold * std::pow((0.25 / 0.48) / (1 - 0.25 / 0.48), 1 / judge.slope);
    const ExperimentFit fit = fitted(group(design, judge, 10));
    EXPECT_TRUE(fit.found);
    EXPECT_NEAR(fit.jnd.value / wanted, 1, 0.05);
    EXPECT_LT(fit.jnd.low, wanted);
    EXPECT_GT(fit.jnd.high, wanted);
    EXPECT_EQ(fit.distance_exponent, 0);
    EXPECT_EQ(fit.reference_px, 128);
  }
}

TEST(FitExperiment, DistanceDecidesTheProfilesExponent) {
  const ExperimentDesign design = simulated_design({64, 128, 256}, 16);
  const auto exponent_of = [&](double truth) {
    SimulatedJudge judge;
    judge.exponent = truth, judge.threshold = 0.09;
    return fitted(group(design, judge, 8));
  };
  const ExperimentFit printed = exponent_of(0), half = exponent_of(0.6);
  EXPECT_EQ(printed.distance_exponent, 0);
  EXPECT_NE(printed.distance_verdict.find("as the thesis prints"), std::string::npos);
  EXPECT_NEAR(half.distance_exponent, 0.6, 0.12);
  EXPECT_EQ(half.reference_px, 128);
  EXPECT_NEAR(half.jnd.value, 0.09, 0.006);
}

TEST(FitExperiment, MovesTellWhereEachChangeLooksAlikeAndTheSameThreshold) {
  const ExperimentDesign design = testing::simulated_moves(320, 8);
  SimulatedJudge judge;
  judge.exponent = 1, judge.threshold = 0.1;
  for (const std::size_t count : {3, 8}) {  // few: answers are drawn, else judges
    const ExperimentFit fit = fitted(group(design, judge, count));
    EXPECT_EQ(fit.kept(), count);
    EXPECT_EQ(fit.answers, count * 7 * 8);
    ASSERT_EQ(fit.matches.size(), 7u);
    for (const auto& [level, px] : fit.matches) {
      const double wanted = std::clamp(128 * 0.1 / level.level, 320 * std::pow(0.87, 20), 320.0);
      EXPECT_NEAR(px.value / wanted, 0.95, 0.1) << level.level;  // places are 13 % apart
      EXPECT_EQ(level.answers, count * 8);
    }
    EXPECT_TRUE(fit.found) << fit.verdict;
    EXPECT_NEAR(fit.distance_exponent, 1, 0.12) << fit.distance_verdict;
    EXPECT_NEAR(fit.jnd.value / (12.8 / fit.reference_px), 1, 0.12);
    EXPECT_NE(fit_text(fit).find("looks like the unchanged one"), std::string::npos);
    EXPECT_NE(fit_page(fit).find("Where both look alike"), std::string::npos);
    EXPECT_NE(jnd_profile_json(fit).find("moved until alike"), std::string::npos);
  }
}

TEST(FitExperiment, JudgesWhoDoNotMoveOrDoNotLookAreLeftOut) {
  const ExperimentDesign design = testing::simulated_moves(320, 8);
  SimulatedJudge good, still, guesses;
  good.exponent = 1;
  still.habit = Habit::kLeftKey, guesses.habit = Habit::kGuesses;
  std::vector<ExperimentResults> results = group(design, good, 4);
  results.push_back(simulated_results(design, still, 10));
  results.push_back(simulated_results(design, guesses, 12));
  const ExperimentFit fit = fitted(results);
  EXPECT_EQ(fit.kept(), 4u);
  EXPECT_EQ(fit.judges[4].verdict, JudgeVerdict::kOneSide);
  EXPECT_EQ(fit.judges[5].verdict, JudgeVerdict::kInattentive);
  results[1].places_px[2] += 1;
  EXPECT_NE(refused(results).find("/places_px"), std::string::npos);
}

TEST(FitExperiment, ChangesThatAllLookAlikeFromOneSizeOnHaveNoThreshold) {
  SimulatedJudge judge;  // the same at every distance: seen everywhere, or nowhere
  const ExperimentFit fit = fitted(group(testing::simulated_moves(320, 8, 0.99), judge, 6));
  EXPECT_EQ(fit.matches.front().second.value, 320);
  EXPECT_NEAR(fit.distance_exponent, 0, 0.05);
  judge.threshold = 0.5;
  EXPECT_FALSE(fitted(group(testing::simulated_moves(320, 8), judge, 6)).found);
}

TEST(FitExperiment, BadJudgesAreLeftOutWithNumbers) {
  const ExperimentDesign design = simulated_design({128}, 12);
  std::vector<ExperimentResults> results = group(design, {}, 4);
  SimulatedJudge left, guesses;
  left.habit = Habit::kLeftKey, guesses.habit = Habit::kGuesses;
  results.push_back(simulated_results(design, left, 10));
  results.push_back(simulated_results(design, guesses, 12));
  results.push_back(simulated_results(design, {}, 13, 3));
  results.push_back(results[0]);
  results.back().file = "again.json";
  results.push_back(simulated_results(design, {}, 14, 0));
  const ExperimentFit fit = fitted(results);
  ASSERT_EQ(fit.judges.size(), 9u);
  EXPECT_EQ(fit.kept(), 4u);
  EXPECT_EQ(verdict_text(fit.judges[4]), "left out: 92 of 92 answers are \"left\"");
  EXPECT_EQ(fit.judges[5].verdict, JudgeVerdict::kInattentive);
  EXPECT_NE(verdict_text(fit.judges[5]).find(" of 8 catch trials are right"), std::string::npos);
  EXPECT_NE(verdict_text(fit.judges[6]).find("left out: 3 answers"), std::string::npos);
  EXPECT_TRUE(fit.judges[7].repeated);
  EXPECT_EQ(fit.judges[8].verdict, JudgeVerdict::kTooFew);
  EXPECT_EQ(fit.answers, 4u * 7 * 12);
  EXPECT_EQ(fit.jnd.value, fitted(group(design, {}, 4)).jnd.value);  // they change nothing
}

TEST(FitExperiment, NobodyLeftIsAnErrorWithNumbers) {
  const ExperimentDesign design = simulated_design({128}, 4);
  const std::string why = refused({simulated_results(design, {}, 1, 3)});
  EXPECT_NE(why.find("none of 1"), std::string::npos) << why;
  EXPECT_NE(why.find("3 answers"), std::string::npos) << why;
  EXPECT_NE(refused({}), "");
}

TEST(FitExperiment, OtherExperimentsAreRefused) {
  const ExperimentDesign design = simulated_design({128}, 4), other = simulated_design({128}, 4, 9);
  const std::string why = refused({simulated_results(design, {}, 1), simulated_results(other, {}, 2)});
  EXPECT_NE(why.find("judge-2.json: /design: expected " + design.id + ", as judge-1.json, found " + other.id),
            std::string::npos)
      << why;
  EXPECT_NE(refused({simulated_results(design, {}, 1)}, key_of(other)).find("the given design"),
            std::string::npos);
  EXPECT_EQ(refused({simulated_results(design, {}, 1)}, key_of(design)), "");
}

TEST(FitExperiment, AnswersThatWereChangedAreRefused) {
  const ExperimentDesign design = simulated_design({128}, 4);
  ExperimentResults changed = simulated_results(design, {}, 1);
  changed.answers[5].level = 0.9;
  EXPECT_NE(refused({changed}, key_of(design)).find("judge-1.json: /answers/5"), std::string::npos);
  EXPECT_NE(refused({simulated_results(design, {}, 2), changed}).find("judge-1.json: /answers/5"),
            std::string::npos);
  changed = simulated_results(design, {}, 1);
  changed.trials += 1;
  EXPECT_NE(refused({simulated_results(design, {}, 2), changed}).find("/trials"), std::string::npos);
}

TEST(FitExperiment, AThresholdOutsideTheLevelsIsNone) {
  SimulatedJudge blind;
  blind.threshold = 0.44;  // catch trials are seen
  const ExperimentFit fit = fitted(group(simulated_design({128}, 20), blind, 4));
  EXPECT_FALSE(fit.found);
  EXPECT_NE(fit.verdict.find("No threshold"), std::string::npos);
  EXPECT_NE(fit.verdict.find("0.28"), std::string::npos);
}

TEST(FitExperiment, TheProfileIsOneThatCompileTakes) {
  const ExperimentFit fit = fitted(group(simulated_design({64, 256}, 12), {}, 6));
  const std::string text = jnd_profile_json(fit);
  CompileOptions options;
  read_jnd_profile(options, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, "p.json");
  EXPECT_NEAR(options.perceptual_values.jnd, fit.jnd.value, 1e-4);
  EXPECT_EQ(options.perceptual_values.jnd_reference_px, 128);
  EXPECT_EQ(options.perceptual_values.jnd_distance_exponent, fit.distance_exponent);
  const auto profile = nlohmann::json::parse(text);
  EXPECT_NE(profile["method"].get<std::string>().find("6 judges (0 left out)"), std::string::npos);
}

TEST(FitExperiment, TheLineHasOneThreshold) {
  FitOptions options;
  options.curve = FittedCurve::kLine;
  const ExperimentFit fit = fitted(group(simulated_design({128}, 20), {}, 6), options);
  EXPECT_TRUE(fit.found);
  EXPECT_EQ(fit.jnd.value, fit.study.pooled.line.threshold);
  EXPECT_NEAR(fit.jnd.value, 0.1, 0.03);
}

TEST(FitExperiment, SameFilesSameTexts) {
  const std::vector<ExperimentResults> results = group(simulated_design({64, 128}, 8), {}, 3);
  const ExperimentFit one = fitted(results), again = fitted(results);
  EXPECT_EQ(fit_json(one), fit_json(again));
  EXPECT_EQ(fit_text(one), fit_text(again));
  EXPECT_EQ(fit_page(one), fit_page(again));
}

TEST(FitExperiment, NamesOfFilesAndJudgesStayText) {
  std::vector<ExperimentResults> results = group(simulated_design({128}, 8), {}, 2);
  results[0].judge = "<b>";
  EXPECT_NE(fit_page(fitted(results)).find("&lt;b&gt;"), std::string::npos);
}

}  // namespace texmesh::fit_experiment_test
