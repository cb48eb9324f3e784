#include "format/rules/picture_prediction.h"

#include <gtest/gtest.h>

#include <cmath>

namespace texmesh::picture_prediction_test {

PictureLosses losses(std::vector<float> flip) { return {flip, flip, flip}; }

/// Two displayed heights, colours alone; losses are exact in binary.
QualityTable make_table(float exponent = 1) {
  QualityTable t{1, {64, 1024}, {0, 4, 8}, {}, {}, exponent, 0};
  t.geometry = {losses({0, 0.125f, 0.25f}), losses({0, 0.25f, 0.5f})};
  const TextureLosses small{{0.015625f, 0.25f},
                            losses({0.03125f, 0.125f}),
                            losses({0.125f}),
                            losses({0.03125f, 0.015625f, 0}),
                            losses({0.0625f, 0.125f})};
  const TextureLosses large{{0.015625f, 0.25f},
                            losses({0.0625f, 0.25f}),
                            losses({0.375f}),
                            losses({0.0625f, 0.03125f, 0}),
                            losses({0.125f, 0.25f})};
  t.groups = {{PlaneGroup::kColour, {small, large}}};
  return t;
}

TEST(GroupCurve, GoesThroughTheSamples) {
  const QualityTable t = make_table();
  const GroupCurve at64(t, PlaneGroup::kColour, 64), at1024(t, PlaneGroup::kColour, 1024);
  EXPECT_NEAR(at64.coded(0.015625), 0.03125, 1e-12);
  EXPECT_NEAR(at64.coded(0.25), 0.125, 1e-12);
  EXPECT_NEAR(at1024.coded(0.25), 0.25, 1e-12);
  EXPECT_NEAR(at64.coded(0.0625), 0.0625, 1e-12) << "half the way in logarithms";
  EXPECT_EQ(at64.halved({0, 0}, 4), 0.03125);
  EXPECT_EQ(at64.halved({-1, -1}, 4), 0.015625);
  EXPECT_EQ(at64.halved({-2, -2}, 4), 0);
  EXPECT_EQ(at64.halved({-9, -9}, 4), 0) << "the finest level's";
  EXPECT_EQ(at64.halved({1, 1}, 4), 0.0625);
  EXPECT_EQ(at64.halved({1.5, 1.5}, 4), 0.09375);
  EXPECT_EQ(at64.halved({3, 3}, 8), 0.1875) << "goes on behind the last level";
  EXPECT_EQ(at64.halved({99, 99}, 200), 1);
}

TEST(GroupCurve, BehindTheCoarsestSampleMipsGoTowardsThePreview) {
  QualityTable t = make_table();
  const auto at64 = [&](float preview) {
    t.groups[0].sizes[0].preview.flip = {preview};
    return GroupCurve(t, PlaneGroup::kColour, 64);
  };
  // Samples end at level 2 with .125. The preview of a plane of growth and mip 3 is of level 3, where the
  // line has .1875; that of mip 2 and growth 3 is of level 4.
  EXPECT_EQ(at64(0.75f).halved({3, 3}, 3), 0.375 - 0.03125)
      << "the geometric mean, less what full size loses";
  EXPECT_EQ(at64(0.75f).halved({2, 2}, 3), 0.125 - 0.015625) << "samples are as they were";
  EXPECT_EQ(at64(0.125f).halved({3, 3}, 3), 0.1875 - 0.03125) << "not below the line";
  EXPECT_EQ(at64(1).halved({3, 3}, 2), (0.125 + 0.5) / 2 - 0.0625) << "half the way to level 4";
}

TEST(GroupCurve, LinesBeyondTheSamplesAreNeitherSteepNorFlat) {
  const auto curve = [](float first, float second) {
    QualityTable t = make_table();
    for (TextureLosses& l : t.groups[0].sizes) l.coded = losses({first, second});
    return GroupCurve(t, PlaneGroup::kColour, 64);
  };
  // Between the samples 1 - SSIM grows 16 times; FLIP 64 times, not at all, and 4 times.
  const GroupCurve steep = curve(0.00390625f, 0.25f), flat = curve(0.125f, 0.125f),
                   own = curve(0.0625f, 0.25f);
  EXPECT_NEAR(steep.coded(0.5), 0.5, 1e-12) << "twice as much of twice as much";
  EXPECT_NEAR(steep.coded(0.0078125), 0.001953125, 1e-12);
  EXPECT_NEAR(steep.coded(0.0625), 0.03125, 1e-12) << "between the samples as steep as they are";
  EXPECT_NEAR(flat.coded(4), 0.25, 1e-12);
  EXPECT_NEAR(flat.coded(0.0625), 0.125, 1e-12);
  EXPECT_NEAR(own.coded(1), 0.5, 1e-12) << "the nearest line's";
}

TEST(GroupCurve, NothingLostIsNothing) {
  const GroupCurve curve(make_table(), PlaneGroup::kColour, 300);
  EXPECT_EQ(curve.coded(0), 0);
  for (const double growth : {-3.0, 0.0, 2.0})
    EXPECT_EQ(curve.halved({growth, growth}, 0), 0) << "full size is the source's";
  EXPECT_EQ(curve.coded(0, {3, 3}), 0);
}

TEST(GroupCurve, RisesWithDssimAndLevels) {
  const QualityTable t = make_table();
  for (const double px : {10.0, 64.0, 300.0, 1024.0, 5000.0}) {
    const GroupCurve curve(t, PlaneGroup::kColour, px);
    double before = 0;
    for (double dssim = 1e-6; dssim < 2; dssim *= 1.1) {
      const double now = curve.coded(dssim);
      EXPECT_GE(now, before) << px << " px, " << dssim;
      EXPECT_LE(now, 1);
      before = now;
    }
    before = 0;
    for (double level = -4; level < 10; level += 0.125) {
      EXPECT_GE(curve.halved({level, level}, 20), before);
      before = curve.halved({level, level}, 20);
    }
    before = 0;
    for (std::uint32_t mip = 0; mip < 8; ++mip) {
      EXPECT_GE(curve.halved({0.5, 0.5}, mip), before) << "of more texels less is lost";
      before = curve.halved({0.5, 0.5}, mip);
    }
  }
}

TEST(GroupCurve, HeightsBetweenAreLinearInTheLogarithm) {
  const QualityTable t = make_table();
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 256).coded(0.25), (0.125 + 0.25) / 2, 1e-12);
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 256).halved({1, 1}, 4), (0.0625 + 0.125) / 2, 1e-12);
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 8).coded(0.25), 0.125, 1e-12) << "the nearest height";
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 9999).coded(0.25), 0.25, 1e-12);
}

TEST(GroupCurve, LargerTexelsLoseMore) {
  const QualityTable t = make_table();
  constexpr double k = GroupCurve::kLossPerDoubling;
  const GroupCurve at64(t, PlaneGroup::kColour, 64), between(t, PlaneGroup::kColour, 256);
  EXPECT_NEAR(at64.coded(0.015625, {1, 1}), k * 0.03125, 1e-12);
  EXPECT_NEAR(at64.coded(0.015625, {-1, -1}), 0.03125 / GroupCurve::kLossPerHalving, 1e-12);
  EXPECT_NEAR(at64.coded(0.015625, {2, 2}), k * k * 0.03125, 1e-12);
  EXPECT_EQ(at64.coded(0.25, {20, 20}), 1) << "as different as can be";
  EXPECT_NEAR(between.coded(0.25, {1, 0}), (k * 0.125 + 0.25) / 2, 1e-12) << "each height has its own";
  EXPECT_NEAR(between.halved({1, 0}, 4), (0.0625 + 0.0625) / 2, 1e-12);
  EXPECT_NEAR(between.halved({1, 0}, 1), (0.03125 + 0.03125) / 2, 1e-12) << "less than full size loses";
}

TEST(GroupCurve, PreviewsAreThoseOfTheHeight) {
  const QualityTable t = make_table();
  EXPECT_EQ(GroupCurve(t, PlaneGroup::kColour, 64).preview(), 0.125);
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 256).preview(), 0.25, 1e-12);
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 32).preview(), 0.125 / GroupCurve::kLossPerDoubling, 1e-12);
  EXPECT_NEAR(GroupCurve(t, PlaneGroup::kColour, 2048).preview(), 0.375 * GroupCurve::kLossPerDoubling,
              1e-12);
  EXPECT_EQ(GroupCurve(t, PlaneGroup::kColour, 1e6).preview(), 1);
  EXPECT_EQ(GroupCurve(t, PlaneGroup::kNormal, 64).preview(), 1) << "no such group";
}

TEST(SizesAround, AreTheTablesNearest) {
  const QualityTable t = make_table();
  EXPECT_EQ(sizes_around(t, 300), (SizesAround{64, 1024}));
  EXPECT_EQ(sizes_around(t, 5), (SizesAround{64, 1024}));
  EXPECT_EQ(sizes_around({}, 300), (SizesAround{1, 1}));
  QualityTable one = t;
  one.sizes_px = {64};
  EXPECT_EQ(sizes_around(one, 300), (SizesAround{64, 64}));
}

TEST(GroupCurve, GroupsThatTheTableDoesNotHaveLoseTheirTexels) {
  const GroupCurve curve(make_table(), PlaneGroup::kNormal, 300);
  EXPECT_EQ(curve.coded(0.375), 0.375);
  EXPECT_EQ(curve.coded(1.5), 1);
  EXPECT_EQ(curve.halved({2, 2}, 2), 0);
}

TEST(GroupCurve, OneSampleIsALine) {
  QualityTable t = make_table();
  for (TextureLosses& l : t.groups[0].sizes) l = {{0.25f}, losses({0.125f}), losses({0}), {}, {}};
  const GroupCurve curve(t, PlaneGroup::kColour, 64);
  EXPECT_NEAR(curve.coded(0.25), 0.125, 1e-12);
  EXPECT_NEAR(curve.coded(0.0625), 0.125 / 4, 1e-12);
  EXPECT_NEAR(curve.coded(1), 0.125 * 2, 1e-12) << "above it less steep";
}

TEST(GeometryFlip, BetweenScalesAndHeights) {
  const QualityTable t = make_table();
  EXPECT_EQ(geometry_flip(t, 300, 0), 0);
  EXPECT_EQ(geometry_flip(t, 64, 4), 0.125);
  EXPECT_EQ(geometry_flip(t, 64, 6), 0.1875);
  EXPECT_NEAR(geometry_flip(t, 256, 8), 0.375, 1e-12);
  EXPECT_EQ(geometry_flip(t, 64, 99), 0.25) << "the last scale's";
  EXPECT_EQ(geometry_flip({}, 64, 3), 0);
}

TEST(CombinedFlip, AddsUpByTheExponent) {
  const std::vector<double> losses{0.3, 0, 0.4};
  EXPECT_NEAR(combined_flip(make_table(1), losses), 0.7, 1e-12);
  EXPECT_NEAR(combined_flip(make_table(2), losses), 0.5, 1e-12);
  EXPECT_EQ(combined_flip(make_table(2), std::vector<double>{0, 0}), 0);
  EXPECT_EQ(combined_flip(make_table(1), std::vector<double>{0.75, 0.75}), 1);
  EXPECT_NEAR(combined_flip(make_table(3), std::vector<double>{0.25}), 0.25, 1e-12);
}

}  // namespace texmesh::picture_prediction_test
