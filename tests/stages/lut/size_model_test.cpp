#include "stages/lut/lut.h"

#include <gtest/gtest.h>

#include <cmath>

#include "format/rules/size_curve.h"
#include "tests/stages/lut/lut_scene.h"
#include "tests/support/all_rungs.h"

namespace texmesh::size_model_test {

using namespace testing;  // NOLINT: fixtures

/// Two fragments with sizes at the given qualities; the second is not stored.
PlaneTables tables_of(const std::vector<std::uint8_t>& quality, const std::vector<std::uint32_t>& bytes) {
  PlaneTables t;
  t.columns = 2, t.rows = 1;
  t.rung_quality = quality;
  t.order = {0};
  for (const std::uint32_t b : bytes) t.size_bytes.push_back(b), t.size_bytes.push_back(0);
  return t;
}
PlaneLadder ladder_of(std::size_t rungs) {
  PlaneLadder ladder;
  ladder.rungs.resize(rungs);
  return ladder;
}

TEST(SizeModel, FitsAnExponentialExactly) {
  // 500 * 16^Q is 1000, 2000, 4000 at Q = 1/4, 1/2, 3/4.
  const SizeModel model =
      fit_size_models(ladder_of(3), tables_of({25, 50, 75}, {1000, 2000, 4000}), {0.16f, 0.5f})[0];
  EXPECT_NEAR(model.a, 500, 1e-3);
  EXPECT_NEAR(model.b, 1, 1e-6);  // log 16 / log(100 * .16)
  EXPECT_NEAR(model.correlation, 1, 1e-6);
  EXPECT_NEAR(modelled_bytes(model, 0.16, 0.5), 2000, 0.1);
  EXPECT_NEAR(modelled_quality(model, 0.16, 4000), 0.75, 1e-5);
}

TEST(SizeModel, IsOfFragmentsThatAreStoredAndHaveAPredictor) {
  const PlaneTables t = tables_of({25, 50, 75}, {1000, 2000, 4000});
  EXPECT_EQ(fit_size_models(ladder_of(3), t, {0.5f, 0.5f})[1], SizeModel{}) << "not stored";
  EXPECT_EQ(fit_size_models(ladder_of(3), t, {0, 0})[0], SizeModel{});
  EXPECT_EQ(fit_size_models(ladder_of(3), t, {0.019f, 0})[0], SizeModel{});
  EXPECT_NE(fit_size_models(ladder_of(3), t, {0.021f, 0})[0], SizeModel{});
  EXPECT_EQ(fit_size_models(ladder_of(1), tables_of({50}, {700}), {0.5f, 0})[0], SizeModel{});
  EXPECT_EQ(fit_size_models(ladder_of(2), tables_of({50, 60}, {700, 700}), {0.5f, 0})[0], SizeModel{});
}

TEST(SizeModel, IsNotFittedOnTheSourcesCoefficients) {
  PlaneLadder ladder = ladder_of(3);
  ladder.source_rung = true;
  const SizeModel model =
      fit_size_models(ladder, tables_of({25, 50, 90}, {1000, 2000, 900000}), {0.16f, 0})[0];
  EXPECT_NEAR(model.a, 500, 1e-3);
  EXPECT_NEAR(model.b, 1, 1e-6);
}

TEST(SizeModel, StandsInTheTablesOfEveryFragment) {
  const Scene scene = make_scene();
  const LutTables made = build_all(scene);
  const PlaneThesis& thesis = made.thesis.planes[0];
  EXPECT_EQ(thesis.models,
            fit_size_models(scene.ladder.planes[0], made.tables.planes[0], scene.predictors.planes[0].vqp));
  std::size_t fitted = 0;
  for (const SizeModel& model : thesis.models)
    if (model != SizeModel{}) {
      ++fitted;
      EXPECT_GT(model.correlation, 0.9f);
      EXPECT_GT(model.a, 0);
      EXPECT_GT(model.b, 0);
    }
  EXPECT_GT(fitted, 4u);
  LadderOptions one = testing::all_rungs();
  one.rungs = {50};
  for (const SizeModel& model : thesis_of(make_scene(one)).models) EXPECT_EQ(model, SizeModel{});
}

}  // namespace texmesh::size_model_test
