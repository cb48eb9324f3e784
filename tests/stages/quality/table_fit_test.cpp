#include "stages/quality/table_fit.h"

#include <gtest/gtest.h>

#include "format/rules/picture_prediction.h"

namespace texmesh::table_fit_test {

GroupCells cells(const std::vector<double>& dssim, double texel_level) {
  GroupCells out;
  for (const double d : dssim) {
    Knot& knot = out.knots.emplace_back();
    knot.dssim = {d};
    knot.weight = {1};
    knot.mean_dssim = d;
  }
  out.texel_level = texel_level;
  return out;
}

PictureLosses same_in_all(std::vector<float> flip) { return {flip, flip, flip}; }

/// What planes without coding lose: as many levels as are measured.
PictureLosses uncoded(float flip) { return same_in_all(std::vector<float>(kFinerLevels + 1, flip)); }

GroupPictures pictures(std::vector<float> coded, float mips) {
  return {same_in_all(std::move(coded)), same_in_all({0.1f}), uncoded(mips), same_in_all({mips, mips})};
}

const std::vector<double> kDssim{0.04, 0.1, 0.37};

TEST(TableFit, WithTheSameMipsAndTexelsLossesStay) {
  const GroupCells group = cells(kDssim, 0.5);
  const PictureLosses out = along_curve(group, group, pictures({0.05f, 0.06f, 0.12f}, 0.04f), uncoded(0.04f));
  ASSERT_EQ(out.flip.size(), 3u);
  EXPECT_NEAR(out.flip[0], 0.05, 1e-5);
  EXPECT_NEAR(out.flip[1], 0.06, 1e-5);
  EXPECT_NEAR(out.flip_p95[2], 0.12, 1e-5);
}

TEST(TableFit, WhatMipsLoseDoesNotGrowWithTexels) {
  const GroupCells smaller = cells(kDssim, 0), larger = cells(kDssim, 1);
  const PictureLosses out =
      along_curve(larger, smaller, pictures({0.0762f, 0.08f, 0.12f}, 0.0759f), uncoded(0.0414f));
  EXPECT_GT(out.flip[0], 0.0414f);
  EXPECT_LT(out.flip[0], 0.045f);
  EXPECT_GT(out.flip[2], 1.2f * 0.12f);  // coding adds most of it
  EXPECT_LT(out.flip[2], 1.6f * 0.12f);
}

TEST(TableFit, WhatOnlyMipsLoseIsWhatTheyLose) {
  const GroupCells group = cells(kDssim, 0);
  const PictureLosses out = along_curve(group, group, pictures({0.05f, 0.05f, 0.05f}, 0.05f), uncoded(0.02f));
  for (const float f : out.flip) EXPECT_NEAR(f, 0.02, 1e-5);
  EXPECT_EQ(along_curve(group, cells({}, 0), pictures({}, 0.05f), uncoded(0.02f)).flip.size(), 0u);
}

TEST(TableFit, APlaneThatWasNotRenderedLosesNoLessThanWhereItIsShownSmaller) {
  GroupCells smaller = cells(kDssim, 0), larger = cells(kDssim, 1);
  smaller.mips = {{2, 1}}, larger.mips = {{0, 1}};
  larger.coarser.resize(2);
  larger.coarser[0] = {{}};  // rendered
  GroupPictures losses = pictures({0.05f, 0.06f, 0.12f}, 0.004f);
  losses.finer.flip[0] = losses.finer.flip_p95[0] = 0.05f;  // mip 2 of charts of a few texels
  PictureLosses coarser = same_in_all({0.02f, 0.021f});
  raise_to_smaller(larger, smaller, losses, coarser);
  EXPECT_EQ(coarser.flip, (std::vector<float>{0.02f, 0.05f}));
  larger.mips = {{2, 1}};  // the same plane
  coarser = same_in_all({0.02f, 0.021f});
  losses.coarser = same_in_all({0.06f, 0.07f});
  raise_to_smaller(larger, smaller, losses, coarser);
  EXPECT_EQ(coarser.flip, (std::vector<float>{0.02f, 0.07f}));
}

/// Sizes 64, 128 and 256 px; all that is lost grows to 1.2 of it from 128 to 256 px.
QualityTable small_table() {
  QualityTable table;
  table.sizes_px = {64, 128, 256};
  table.scales = {0, 3};
  table.groups = {{PlaneGroup::kColour, {}}};
  for (const float grown : {0.7f, 1.f, 1.2f}) {
    table.geometry.push_back(same_in_all({0, 0.1f * grown}));
    table.groups[0].sizes.push_back({{0.1f},
                                     same_in_all({0.05f * grown}),
                                     same_in_all({0.2f * grown}),
                                     uncoded(0.001f),
                                     same_in_all({0.03f * grown, 0.06f * grown})});
  }
  return table;
}

TEST(TableFit, AnEnlargedSizeTakesThePlaceOfTheFirst) {
  QualityTable table = small_table();
  const QualityTable before = table;
  enlarge({0}, table);
  EXPECT_EQ(table.sizes_px, (std::vector<std::uint32_t>{128, 256, 512}));
  EXPECT_EQ(table.geometry[1], before.geometry[2]);
  EXPECT_EQ(table.groups[0].sizes[1], before.groups[0].sizes[2]);
  EXPECT_EQ(table.geometry[2].flip[0], 0);
  EXPECT_NEAR(table.geometry[2].flip[1], 0.12 * 1.12, 1e-6);
  const TextureLosses& grown = table.groups[0].sizes[2];
  EXPECT_EQ(grown.texel_dssim, before.groups[0].sizes[2].texel_dssim);
  EXPECT_NEAR(grown.coded.flip[0], 0.06 * GroupCurve::kLossPerDoubling, 1e-6);
  EXPECT_NEAR(grown.preview.flip[0], 0.24 * 1.1, 1e-6);
  EXPECT_NEAR(grown.coarser.flip[1], 0.072 * 1.48, 1e-6);
}

TEST(TableFit, EnlargedSizesGrowLessAndLess) {
  QualityTable table = small_table();
  enlarge({0}, table);
  enlarge({1}, table);
  EXPECT_EQ(table.sizes_px, (std::vector<std::uint32_t>{256, 512, 1024}));
  const auto growths = [](float a, float b, float c) { return std::pair(b / a, c / b); };
  const auto [first, second] =
      growths(table.geometry[0].flip[1], table.geometry[1].flip[1], table.geometry[2].flip[1]);
  EXPECT_GT(first, second);
  EXPECT_GT(second, 1);
  const std::vector<TextureLosses>& sizes = table.groups[0].sizes;
  EXPECT_NEAR(sizes[2].coarser.flip[0] / sizes[1].coarser.flip[0], 1 + 0.48 * 0.4, 1e-5);
}

TEST(TableFit, EnlargedLossesEndAtOne) {
  QualityTable table = small_table();
  table.geometry[2].flip = {0, 0.99f};
  table.groups[0].sizes[2].coarser.flip = {0.9f, 0.95f};
  table.groups[0].sizes[2].coded.flip = {0.8f};
  enlarge({0}, table);
  EXPECT_LE(table.geometry[2].flip[1], 1);
  EXPECT_EQ(table.groups[0].sizes[2].coarser.flip[1], 1);
  EXPECT_EQ(table.groups[0].sizes[2].coded.flip[0], 1);
}

}  // namespace texmesh::table_fit_test
