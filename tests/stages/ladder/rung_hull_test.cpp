#include "stages/ladder/rung_hull.h"

#include <gtest/gtest.h>

#include <utility>

namespace texmesh {
namespace {

using Keep = std::vector<std::uint8_t>;

TEST(WorthStoring, NothingOfNothing) { EXPECT_TRUE(worth_storing({}, 0).empty()); }

TEST(WorthStoring, WhatNoMixtureOfOthersBeats) {
  const std::vector<RungPair> pairs{{0, 0, 100, 0.8}, {0, 1, 400, 0.1}, {0, 2, 1000, 0.0},
                                    {1, 0, 50, 0.5},  {1, 1, 90, 0.3},  {1, 2, 300, 0.29}};
  EXPECT_EQ(worth_storing(pairs, 0), (Keep{1, 1, 1, 1, 1, 0}));
  EXPECT_EQ(worth_storing(pairs, -1), (Keep{1, 1, 1, 1, 1, 1}));
}

TEST(WorthStoring, NotWhatTheHullHardlyRisesWithout) {
  // At 200 bytes the hull between (100, 0.3) and (400, 0.1) is 0.2333: 1.0606 times 0.22.
  const std::vector<RungPair> pairs{{0, 0, 400, 0.1}, {0, 1, 1000, 0}, {1, 0, 100, 0.3}, {1, 1, 200, 0.22}};
  EXPECT_EQ(worth_storing(pairs, 0.06), (Keep{1, 1, 1, 1}));
  EXPECT_EQ(worth_storing(pairs, 0.061), (Keep{1, 1, 1, 0}));
}

TEST(WorthStoring, TheLeastGoesFirstAndMakesItsNeighboursWorthMore) {
  // The pair of 300 bytes is worth 0.9 %, that of 200 bytes 10 %, but 16 % when the other is gone.
  const std::vector<RungPair> pairs{
      {0, 0, 500, 0.1}, {0, 1, 1000, 0}, {1, 0, 100, 0.4}, {1, 1, 200, 0.28}, {1, 2, 300, 0.218}};
  EXPECT_EQ(worth_storing(pairs, 0), (Keep{1, 1, 1, 1, 1}));
  EXPECT_EQ(worth_storing(pairs, 0.12), (Keep{1, 1, 1, 1, 0}));
  EXPECT_EQ(worth_storing(pairs, 0.17), (Keep{1, 1, 1, 0, 0}));
}

TEST(WorthStoring, FullSizeKeepsEveryRung) {
  const std::vector<RungPair> pairs{{0, 0, 100, 0.9}, {0, 1, 200, 0.2}, {0, 2, 300, 0.199},
                                    {0, 3, 900, 0},   {1, 0, 50, 0.5},  {1, 1, 60, 0.49}};
  EXPECT_EQ(worth_storing(pairs, 0), (Keep{1, 1, 1, 1, 1, 0}));
  EXPECT_EQ(worth_storing(pairs, 1e9), (Keep{1, 1, 1, 1, 1, 0}));
}

TEST(WorthStoring, EveryPlaneKeepsARung) {
  const std::vector<RungPair> pairs{{0, 0, 10, 0.1}, {0, 1, 20, 0}, {1, 0, 15, 0.4}, {1, 1, 30, 0.3}};
  const Keep keep = worth_storing(pairs, 0);
  EXPECT_EQ(keep[0] + keep[1], 2);
  EXPECT_EQ(keep[2] + keep[3], 1);
}

Keep for_display(const std::vector<MipChoice>& choices, double gain, Keep keep) {
  return keep_for_display(choices, 0.02, gain, std::move(keep));
}

TEST(KeepForDisplay, TheFirstThatShowsTheMipWellAndNoneAbove) {
  const std::vector<MipChoice> own{{0, 0.2}, {10, 0.05}, {20, 0.02}, {40, 0.01}};
  EXPECT_EQ(for_display(own, 1e9, {0, 0, 0}), (Keep{0, 1, 0}));
  EXPECT_EQ(for_display(own, 1e9, {0, 0, 1}), (Keep{0, 1, 1}));  // what the full size needs stays
}

TEST(KeepForDisplay, TheLastWhereNoneShowsItWell) {
  EXPECT_EQ(for_display({{0, 0.2}, {10, 0.1}, {20, 0.05}}, 1e9, {0, 0}), (Keep{0, 1}));
  EXPECT_EQ(for_display({{0, 0.01}, {10, 0.5}, {20, 0.4}}, 1e9, {1, 0}), (Keep{0, 1}));
}

TEST(KeepForDisplay, NothingThatShowsLessThanThePreview) {
  const std::vector<MipChoice> own{{0, 0.1}, {10, 0.3}, {20, 0.1}, {40, 0.01}};
  EXPECT_EQ(for_display(own, 0, {1, 1, 0}), (Keep{0, 0, 1}));
}

TEST(KeepForDisplay, VerticesBetweenWithoutWhichMuchMoreIsLost) {
  // At 20 bytes the line from (0, 0.2) to (40, 0.02) is at 0.11: 1.8 times 0.06.
  const std::vector<MipChoice> own{{0, 0.2}, {10, 0.19}, {20, 0.06}, {40, 0.02}};
  EXPECT_EQ(for_display(own, 0.8, {0, 0, 0}), (Keep{0, 1, 1}));
  EXPECT_EQ(for_display(own, 0.9, {0, 0, 0}), (Keep{0, 0, 1}));
  EXPECT_EQ(for_display(own, 0.9, {1, 0, 0}), (Keep{1, 0, 1}));
}

TEST(KeepForDisplay, NothingOfNothing) {
  EXPECT_EQ(for_display({}, 0, {1, 0}), (Keep{1, 0}));
  EXPECT_EQ(for_display({{0, 0.1}}, 0, {}), Keep{});
}

}  // namespace
}  // namespace texmesh
