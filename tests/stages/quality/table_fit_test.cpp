#include "stages/quality/table_fit.h"

#include <gtest/gtest.h>

namespace texmesh::quality {
namespace {

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

}  // namespace
}  // namespace texmesh::quality
