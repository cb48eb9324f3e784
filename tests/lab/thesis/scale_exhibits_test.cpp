#include <gtest/gtest.h>

#include "lab/thesis/exhibits.h"
#include "lab/thesis/made_models.h"
#include "tests/lab/thesis/exhibit_rows.h"

namespace texmesh::scale_exhibits_test {

using namespace testing;  // NOLINT: fixtures

TEST(MadeScans, HaveThePrintedCounts) {
  const Model head = make_scan_model(MadeShape::kHead, 36, 52, 0, {});
  EXPECT_EQ(head.mesh.positions.size(), 1872u);
  EXPECT_EQ(head.mesh.triangles.size(), 3672u);
  EXPECT_EQ(make_scan_model(MadeShape::kNutcracker, 18, 36, 0, {}).mesh.triangles.size(), 1260u);
  EXPECT_EQ(make_scan_model(MadeShape::kHead, 36, 52, 0, {}).mesh, head.mesh);
  const RangeGrid fine = made_ring(MadeShape::kHead, 360), coarse = made_ring(MadeShape::kHead, 36);
  for (std::size_t k = 0; k < 36; ++k)
    EXPECT_EQ(coarse.radius[k], fine.radius[10 * k]) << "every tenth value";
}

TEST(ScaleExhibits, Table21CountsVerticesAndFaces) {
  const std::vector<Exhibit> made = scale_exhibits({});
  expect_sound(made);
  const Exhibit& e = exhibit_of(made, "2.1");
  ASSERT_EQ(e.tables[0].rows.size(), 5u);
  EXPECT_NEAR(number_at(e, 0, 0, 3), 36.59, 0.01);   // 685 of 1,872
  EXPECT_NEAR(number_at(e, 0, 4, 3), 63.89, 0.01);   // 1,196
  EXPECT_NEAR(number_at(e, 0, 0, 7), 2.111, 0.001);  // (3,672 - 2,226) / 685
  for (std::size_t k = 0; k < 5; ++k) {
    EXPECT_LE(number_at(e, 0, k, 8), 2.0 + 1e-9) << "a removed vertex takes two faces, one at the border";
    if (k > 0) EXPECT_GE(number_at(e, 0, k, 2), number_at(e, 0, k - 1, 2));
  }
}

TEST(ScaleExhibits, Fig22CrossingsFallAsSigmaGrows) {
  const std::vector<Exhibit> made = scale_exhibits({});
  const Exhibit& e = exhibit_of(made, "fig-2.2");
  ASSERT_EQ(e.tables[0].rows.size(), 5u);
  for (std::size_t k = 1; k < 5; ++k) {
    EXPECT_LE(number_at(e, 0, k, 1), number_at(e, 0, k - 1, 1));
    EXPECT_GT(number_at(e, 0, k, 3), number_at(e, 0, k - 1, 3)) << "sigma";
    EXPECT_LT(number_at(e, 0, k, 4), number_at(e, 0, k - 1, 4)) << "range";
    EXPECT_EQ(static_cast<int>(number_at(e, 0, k, 1)) % 2, 0) << "signs change in pairs around a ring";
  }
  EXPECT_EQ(e.verdict, number_at(e, 0, 4, 1) <= 2 ? Verdict::kConfirmed : Verdict::kInPart) << e.finding;
}

TEST(ScaleExhibits, Fig62CurvesFall) {
  const std::vector<Exhibit> made = scale_exhibits({});
  const Exhibit& e = exhibit_of(made, "fig-6.2");
  ASSERT_EQ(e.plots[0].series.size(), 4u);
  for (const PlotSeries& s : e.plots[0].series) {
    ASSERT_GT(s.points.size(), 20u);
    for (std::size_t k = 1; k < s.points.size(); ++k) {
      EXPECT_GT(s.points[k].first, s.points[k - 1].first);
      // A window that is cut off at 1.4 sigma is no Gaussian: the range may rise by a hundredth of S_0's.
      EXPECT_LE(s.points[k].second, s.points[k - 1].second + 0.01);
    }
    EXPECT_LT(s.points.back().second, 0.2);
  }
  EXPECT_EQ(e.verdict, Verdict::kConfirmed) << e.finding;
}

}  // namespace texmesh::scale_exhibits_test
