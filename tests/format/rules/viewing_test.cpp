#include "format/rules/viewing.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "format/base/errors.h"

namespace texmesh::viewing_test {

/// Scales 0, 3, 7, 9; heights up to which the coarser three are enough by JND, error, edges and lit pictures.
Manifest make_manifest() {
  Manifest m;
  m.object_height = 2;
  m.scales.resize(4);
  const int number[4]{0, 3, 7, 9};
  const double jnd[4]{kAnyDisplayPx, 4000, 500, 80}, error[4]{kAnyDisplayPx, 2000, 400, 100},
      edge[4]{kAnyDisplayPx, 360, 90, 40}, flip[4]{kAnyDisplayPx, 1024, 362, 64};
  for (std::size_t k = 0; k < 4; ++k) {
    ManifestScale& s = m.scales[k];
    s.scale = number[k];
    s.triangles = static_cast<std::uint32_t>(160000 >> (4 * k));
    s.display_px_jnd = jnd[k], s.display_px_error = error[k], s.display_px_edge = edge[k];
    s.display_px_flip = flip[k];
    s.p95 = k == 0 ? 0 : 51.2 / jnd[k];
    s.error_rms = k == 0 ? 0 : 0.5 * m.object_height / error[k];
    s.error_max = 4 * s.error_rms;
  }
  return m;
}

TEST(Viewing, DistanceAndHeightAreInverse) {
  const Camera camera{90, 1000};  // tan 45 degrees = 1: at distance d a length of 2 d fills the picture
  EXPECT_NEAR(displayed_height_px(2, 1, camera), 1000, 1e-9);
  EXPECT_NEAR(displayed_height_px(2, 4, camera), 250, 1e-9);
  for (double px : {1.0, 17.0, 512.0, 5000.0})
    EXPECT_NEAR(displayed_height_px(3, viewing_distance(3, px, {}), {}), px, 1e-9 * px);
  EXPECT_EQ(viewing_distance(2, kAnyDisplayPx, camera), 0);
  EXPECT_EQ(viewing_distance(2, 0, camera), std::numeric_limits<double>::infinity());
  EXPECT_THROW(displayed_height_px(2, 0, camera), FormatError);
  EXPECT_THROW(displayed_height_px(2, 1, {180, 1000}), FormatError);
  EXPECT_THROW(viewing_distance(2, 10, {0, 1000}), FormatError);
  EXPECT_THROW(viewing_distance(2, 10, {std::nan(""), 1000}), FormatError);
}

/// Fig. 7.13: the nutcracker's major scales are 4, 9, 11, 17 and 20.
TEST(Viewing, EveryDistanceShowsTheMajorScaleOfItsScalesTier) {
  std::vector<ManifestScale> scales;
  for (const int scale : {0, 4, 6, 9, 11, 17, 20}) {
    ManifestScale& s = scales.emplace_back();
    s.scale = scale;
    s.major = scale != 0 && scale != 6;
  }
  const std::vector<ManifestStep> steps = step_function(scales, StepRule::kDistance);
  ASSERT_EQ(steps.size(), 6u);
  for (std::size_t k = 1; k < steps.size(); ++k) EXPECT_GE(steps[k].up_to_px, 1.1999 * steps[k - 1].up_to_px);
  const auto at_distance = [&](double distance) {
    return scale_at(steps, 1024.01 / std::pow(1.2, distance - 1));
  };
  for (int i = 1; i <= 20; ++i)
    EXPECT_EQ(at_distance(i + 0.01), i <= 4 ? 4 : i <= 9 ? 9 : i <= 11 ? 11 : i <= 17 ? 17 : 20) << i;
  EXPECT_EQ(at_distance(100), 20);
  EXPECT_EQ(at_distance(0.9), 0);
  scales.resize(1);
  EXPECT_EQ(step_function(scales, StepRule::kDistance), (std::vector<ManifestStep>{{kAnyDisplayPx, 0}}));
}

TEST(Viewing, StepFunctionsOfEveryRule) {
  const Manifest m = make_manifest();
  const auto steps = [&](StepRule rule) {
    std::vector<std::pair<int, double>> out;
    for (const ManifestStep& s : step_function(m.scales, rule)) out.emplace_back(s.scale, s.up_to_px);
    return out;
  };
  using Steps = std::vector<std::pair<int, double>>;
  EXPECT_EQ(steps(StepRule::kJnd), (Steps{{9, 80}, {7, 500}, {3, 4000}, {0, kAnyDisplayPx}}));
  EXPECT_EQ(steps(StepRule::kError), (Steps{{9, 100}, {7, 400}, {3, 2000}, {0, kAnyDisplayPx}}));
  EXPECT_EQ(steps(StepRule::kFlip), (Steps{{9, 64}, {7, 362}, {3, 1024}, {0, kAnyDisplayPx}}));
  // O_V / E_S 40, 90, 360 and, from 16 times the triangles, 4 * 360 for S_0: the nearer ratio wins.
  EXPECT_EQ(steps(StepRule::kEdge), (Steps{{9, 60}, {7, 180}, {3, 720}, {0, kAnyDisplayPx}}));
}

TEST(Viewing, ScalesThatAcceptNoMoreGiveNoStep) {
  Manifest m = make_manifest();
  m.scales[2].display_px_jnd = 80;  // S_7 no better than S_9
  EXPECT_EQ(step_function(m.scales, StepRule::kJnd).size(), 3u);
  m.scales[3].display_px_jnd = kAnyDisplayPx;  // S_9 equals S_0: S_0 still has the last step
  const std::vector<ManifestStep> steps = step_function(m.scales, StepRule::kJnd);
  ASSERT_EQ(steps.size(), 2u);
  EXPECT_EQ(steps[0].scale, 9);
  EXPECT_LT(steps[0].up_to_px, kAnyDisplayPx);
  m.scales[3].display_px_flip = 0;  // can be told from S_0 at every height
  EXPECT_EQ(step_function(m.scales, StepRule::kFlip).size(), 3u);
  EXPECT_EQ(step_function(m.scales, StepRule::kFlip)[0].scale, 7);
  m.scales.resize(1);
  EXPECT_EQ(step_function(m.scales, StepRule::kEdge), (std::vector<ManifestStep>{{kAnyDisplayPx, 0}}));
}

TEST(Viewing, ScaleAtAHeight) {
  const Manifest m = make_manifest();
  const std::vector<ManifestStep> steps = step_function(m.scales, StepRule::kFlip);
  EXPECT_EQ(scale_at(steps, 0), 9);
  EXPECT_EQ(scale_at(steps, 64), 9);
  EXPECT_EQ(scale_at(steps, 64.1), 7);
  EXPECT_EQ(scale_at(steps, 1025), 0);
  EXPECT_EQ(scale_at(steps, 1e12), 0);
}

TEST(Viewing, ScalesShowAsLongAsTheirTrianglesHaveHalfAPixel) {
  const Manifest m = make_manifest();  // 160,000, 10,000, 625 and 39 triangles
  EXPECT_EQ(finest_shown(m.scales, 283), 0);
  EXPECT_EQ(finest_shown(m.scales, 282), 3);
  EXPECT_EQ(finest_shown(m.scales, 18), 7);
  EXPECT_EQ(finest_shown(m.scales, 1), 9) << "the coarsest, where those of none show";
}

TEST(Viewing, AClippedObjectNeedsTheScaleOfItsPart) {
  const Manifest m = make_manifest();
  // All of it to be seen: the step function's answer.
  EXPECT_EQ(select_scale(m, 300, {190, 300, false}), 7);
  // Displayed 450 px high: JND alone is content with S_7 while it is whole...
  EXPECT_EQ(select_scale(m, 450, {200, 450, false}, StepRule::kJnd), 7);
  // ... and with a part that is large: the part is less high than the object.
  EXPECT_EQ(select_scale(m, 450, {200, 300, true}, StepRule::kJnd), 7);
  // A narrow part: half of 12 px is less than a radius anywhere on the object; one pixel is much of it.
  EXPECT_EQ(select_scale(m, 450, {12, 300, true}, StepRule::kJnd), 3);
  // Far larger than the view: the whole would want S_0, the part is content with S_3.
  EXPECT_EQ(select_scale(m, 6000, {8000, 6000, false}, StepRule::kJnd), 0);
  EXPECT_EQ(select_scale(m, 6000, {800, 600, true}, StepRule::kJnd), 3);
  // The other rules know no shapes.
  EXPECT_EQ(select_scale(m, 6000, {800, 600, true}, StepRule::kError), 0);
  EXPECT_EQ(select_scale(m, 6000, {800, 600, true}, StepRule::kFlip), 0);
  EXPECT_EQ(select_scale(m, 150, {80, 60, true}, StepRule::kEdge), 7);
  // Nothing to be seen.
  EXPECT_EQ(select_scale(m, 6000, {0, 0, true}), 9);
}

TEST(Viewing, ASmallerPartNeverAllowsMoreErrorRelativeToIt) {
  const Manifest m = make_manifest();
  // Narrower and narrower at the same height: never a coarser scale.
  int last = 9;
  for (double width = 400; width >= 1; width /= 1.5) {
    const int scale = select_scale(m, 450, {width, 300, true}, StepRule::kJnd);
    EXPECT_LE(scale, last);
    last = scale;
  }
  EXPECT_EQ(last, 0);
}

}  // namespace texmesh::viewing_test
