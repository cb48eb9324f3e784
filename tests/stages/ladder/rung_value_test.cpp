#include "stages/ladder/rung_value.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "format/rules/viewing.h"

namespace texmesh::rung_value_test {

constexpr double kGain = 0.05, kLeast = 0.01;

/// A texture of one level whose rungs have these bytes and losses.
TextureRungs texture(const std::vector<std::pair<std::uint64_t, double>>& rungs, double preview = 0.5) {
  TextureRungs out;
  out.surface = 1;
  out.texels_across = 1000;
  out.preview_loss = {preview};
  for (std::size_t r = 0; r < rungs.size(); ++r)
    out.pairs.push_back({0, r, rungs[r].first, {rungs[r].second}, false});
  return out;
}

std::vector<std::size_t> kept(const TextureRungs& one, double gain = kGain, double least = kLeast) {
  std::vector<std::size_t> out;
  const auto keep = pairs_worth_storing({one}, texture_loads(), gain, least)[0];
  for (std::size_t k = 0; k < keep.size(); ++k)
    if (keep[k]) out.push_back(k);
  return out;
}

using Rungs = std::vector<std::size_t>;

TEST(RungValue, LoadsAreOrdinaryOnesLessMeshAndTables) {
  const auto ordinary = ordinary_loads();
  const auto loads = texture_loads();
  ASSERT_EQ(loads.size(), ordinary.size());
  for (std::size_t k = 0; k < loads.size(); ++k) {
    EXPECT_EQ(loads[k].displayed_px, ordinary[k].displayed_px);
    EXPECT_GT(loads[k].bytes, 0.5 * ordinary[k].bytes_s * ordinary[k].time_limit_s);
    EXPECT_LT(loads[k].bytes, ordinary[k].bytes_s * ordinary[k].time_limit_s);
  }
}

TEST(RungValue, TheLastPairOfALevelIsACheaperOneWhereAllTakeTooMuch) {
  TextureRungs one = texture({{150'000, 0.001}});
  one.pairs[0].fixed = true;
  one.closes_gaps = false;
  one.preview_loss = {0.5, 0.4};
  one.pairs.push_back({1, 0, 20'000, {0.5, 0.41}, false});  // no better than the preview
  one.pairs.push_back({1, 1, 60'000, {0.3, 0.1}, false});
  one.pairs.push_back({1, 2, 110'000, {0.25, 0.03}, false});
  one.pairs.push_back({1, 3, 140'000, {0.24, 0.01}, false});
  EXPECT_EQ(kept(one, -1, 0), (Rungs{0, 2, 3, 4}));
  for (const auto& [most, rest] : {std::pair{300e3, 4u}, {270e3, 3u}, {220e3, 2u}, {180e3, 2u}}) {
    one.most_bytes = most;
    EXPECT_EQ(kept(one), (Rungs{0, rest})) << most;
  }
}

TEST(RungValue, ADominatedRungGoes) {
  EXPECT_EQ(kept(texture({{500'000, 0.1}, {600'000, 0.12}, {5'000'000, 0.01}})), (Rungs{0, 2}));
}

TEST(RungValue, ARungAboveTheHullGoes) {
  EXPECT_EQ(kept(texture({{400'000, 0.2}, {3'900'000, 0.199}, {4'000'000, 0.01}}), 0), (Rungs{0, 2}));
}

TEST(RungValue, ARungThatNoLoadCanAffordGoes) {
  EXPECT_EQ(kept(texture({{500'000, 0.1}, {4'000'000'000, 0.001}})), (Rungs{0}));
}

TEST(RungValue, ARungThatOnlyPoorerLoadsWantGoes) {
  EXPECT_EQ(kept(texture({{1'000, 0.3}, {50'000, 0.1}, {90'000, 0.01}})), (Rungs{2}));
}

TEST(RungValue, WhatIsFixedStays) {
  TextureRungs one = texture({{500'000, 0.1}, {4'000'000'000, 0.001}});
  one.pairs[1].fixed = true;
  EXPECT_EQ(kept(one), (Rungs{0, 1}));
}

TEST(RungValue, ARungNoBetterThanThePreviewGoes) {
  EXPECT_EQ(kept(texture({{300'000, 0.5}, {5'000'000, 0.1}}), -1, 0), (Rungs{1}));
  EXPECT_EQ(kept(texture({{300'000, 0.6}, {5'000'000, 0.5}}), -1, 0), (Rungs{1}));  // one stays, the better
}

TEST(RungValue, TheMoreIsAskedTheFewerStay) {
  std::vector<std::pair<std::uint64_t, double>> rungs;
  for (int k = 0; k < 12; ++k)
    rungs.push_back({static_cast<std::uint64_t>(100e3 * std::pow(1.5, k)), 0.2 * std::pow(0.72, k)});
  const TextureRungs one = texture(rungs);
  std::size_t before = kept(one, 0, 0).size();
  EXPECT_EQ(before, 12u);
  for (const double gain : {0.02, 0.1, 0.5, 1e9}) {
    const std::size_t now = kept(one, gain).size();
    EXPECT_LE(now, before);
    before = now;
  }
  EXPECT_EQ(before, 1u);
  EXPECT_EQ(kept(one, 0, 2).size(), 1u);  // more loads than there are
}

TEST(RungValue, NeighboursAreNoFurtherApartThanTheLadderCanBring) {
  std::vector<std::pair<std::uint64_t, double>> rungs;
  for (int k = 0; k < 12; ++k)
    rungs.push_back({static_cast<std::uint64_t>(500e3 * std::pow(1.4, k)), 0.3 * std::pow(0.8, k)});
  TextureRungs one = texture(rungs);
  one.pairs.front().fixed = one.pairs.back().fixed = true;
  const Rungs all = kept(one, 1e9);
  EXPECT_GE(all.size(), 5u);
  EXPECT_LE(all.size(), 8u);
  for (std::size_t k = 1; k < all.size(); ++k)
    EXPECT_LE(static_cast<double>(rungs[all[k]].first), 2.5 * static_cast<double>(rungs[all[k - 1]].first));
  // Where the finer ones save what nobody sees, they may be further apart.
  TextureRungs flat = one;
  for (RungPair& pair : flat.pairs) pair.loss[0] *= 0.02;
  EXPECT_EQ(kept(flat, 1e9), (Rungs{0, 11}));
}

TEST(RungValue, WhatClosesAGapGoesWhereAllTakeTooMuch) {
  TextureRungs one = texture({{300'000, 0.3}, {700'000, 0.2}, {1'500'000, 0.1}, {3'000'000, 0.01}});
  one.pairs.front().fixed = one.pairs.back().fixed = true;
  EXPECT_EQ(kept(one, 1e9), (Rungs{0, 1, 2, 3}));
  one.most_bytes = 4'900'000;
  EXPECT_EQ(kept(one, 1e9).size(), 3u);
  one.most_bytes = 3'900'000;
  EXPECT_EQ(kept(one, 1e9), (Rungs{0, 3}));
}

TEST(RungValue, GapsOfTexturesThatDoNotCloseThemStay) {
  TextureRungs one = texture({{300'000, 0.3}, {700'000, 0.2}, {1'500'000, 0.1}, {3'000'000, 0.01}});
  one.pairs.front().fixed = one.pairs.back().fixed = true;
  one.closes_gaps = false;
  EXPECT_EQ(kept(one, 1e9), (Rungs{0, 3}));
}

TEST(RungValue, EveryLevelKeepsAPair) {
  TextureRungs one = texture({{500'000, 0.1}, {5'000'000, 0.01}});
  one.texels_across = 100;  // no display wants the mip
  one.preview_loss.push_back(0.4);
  one.pairs.push_back({1, 0, 100'000, {0.3, 0.1}, false});
  one.pairs.push_back({1, 1, 200'000, {0.25, 0.01}, false});
  const auto keep = pairs_worth_storing({one}, texture_loads(), kGain, kLeast)[0];
  EXPECT_EQ(keep[2] + keep[3], 1);
}

TEST(RungValue, SmallDisplaysWantTheMip) {
  // More than 4 texels across a pixel of the largest display: always a mip of level 1 or more.
  TextureRungs one = texture({{500'000, 0.1}, {5'000'000, 0.01}});
  one.texels_across = 8000;
  one.preview_loss.push_back(0.4);
  one.pairs.push_back({1, 0, 300'000, {0.3, 0.1}, false});
  one.pairs.push_back({1, 1, 1'500'000, {0.25, 0.01}, false});
  const auto keep = pairs_worth_storing({one}, texture_loads(), kGain, kLeast)[0];
  EXPECT_EQ(keep[0] + keep[1], 1);
  EXPECT_EQ(keep[2], 1);
  EXPECT_EQ(keep[3], 1);
}

TEST(RungValue, TexturesShareTheBytes) {
  const TextureRungs one = texture({{50'000, 0.2}, {150'000, 0.01}});
  EXPECT_EQ(kept(one), (Rungs{1}));  // alone it always has enough
  const std::vector<TextureRungs> many(60, one);
  const auto keep = pairs_worth_storing(many, texture_loads(), kGain, kLeast);
  for (const auto& k : keep) EXPECT_EQ(k, (std::vector<std::uint8_t>{1, 1}));
}

TEST(RungValue, NothingOfNothing) {
  EXPECT_TRUE(pairs_worth_storing({}, texture_loads(), kGain, kLeast).empty());
  EXPECT_EQ(kept(texture({{1000, 0.1}})), (Rungs{0}));
}

}  // namespace texmesh::rung_value_test
