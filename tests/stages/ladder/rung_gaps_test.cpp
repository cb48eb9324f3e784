#include "stages/ladder/rung_value.h"

#include <gtest/gtest.h>

namespace texmesh::rung_gaps_test {

using Marks = std::vector<std::uint8_t>;

/// One level; the last rung is the source's.
TextureRungs texture(const std::vector<std::pair<std::uint64_t, double>>& rungs) {
  TextureRungs out;
  out.surface = 1;
  out.texels_across = 1000;
  out.preview_loss = {0.5};
  for (std::size_t r = 0; r < rungs.size(); ++r)
    out.pairs.push_back({0, r, rungs[r].first, {rungs[r].second}, r + 1 == rungs.size()});
  return out;
}

/// Loads with all bytes up to 4 MB.
const GivenBytes kGiven = [] {
  GivenBytes out(1);
  for (int k = 1; k <= 400; ++k) out[0].push_back(1e4 * k);
  return out;
}();

const TextureRungs kLadder =
    texture({{200'000, 0.3}, {400'000, 0.2}, {900'000, 0.12}, {1'900'000, 0.08}, {2'000'000, 0.01}});

TEST(RungGaps, APairBetweenNeighboursFarApartClosesTheGap) {
  EXPECT_EQ(gap_closing_pairs(kLadder, Marks{1, 1, 1, 0, 1}, kGiven), (Marks{0, 1, 1, 0, 0}));
  EXPECT_EQ(gap_closing_pairs(kLadder, Marks{1, 1, 1, 1, 1}, kGiven), (Marks{0, 1, 1, 0, 0}));
  // Nobody wants the level, or sees the difference.
  EXPECT_EQ(gap_closing_pairs(kLadder, Marks{1, 1, 1, 0, 1}, GivenBytes(1)), Marks(5));
  TextureRungs faint = kLadder;
  for (RungPair& pair : faint.pairs) pair.loss[0] *= 0.02;
  EXPECT_EQ(gap_closing_pairs(faint, Marks{1, 1, 1, 0, 1}, kGiven), Marks(5));
}

TEST(RungGaps, WhatIsBeatenInBytesAndLossClosesNone) {
  TextureRungs beaten = kLadder;
  beaten.pairs[1].loss[0] = 0.35;
  EXPECT_EQ(gap_closing_pairs(beaten, Marks{1, 1, 0, 0, 1}, kGiven)[1], 0);
}

TEST(RungGaps, SwapsCloseGapsWithinTheLimit) {
  TextureRungs one = kLadder;
  one.most_bytes = 3'600'000;
  Marks keep{0, 0, 0, 0, 1};
  keep[0] = 1;
  swap_pairs(one, kGiven, keep);
  EXPECT_EQ(keep[4], 1);
  EXPECT_LE(bytes_of(one, keep), one.most_bytes);
  EXPECT_EQ(keep[2], 1) << "from 400 or 900 kB to 2 MB";
  Marks dear{1, 0, 0, 1, 1};
  one.most_bytes = 4'100'000;
  swap_pairs(one, kGiven, dear);
  EXPECT_EQ(dear[3], 0) << "others close the gap below it";
  EXPECT_EQ(dear[2], 1);
}

TEST(RungGaps, EveryLevelKeepsAPairAndFixedOnesStay) {
  TextureRungs two = kLadder;
  two.preview_loss.push_back(0.4);
  two.pairs.push_back({1, 0, 3'000'000, {0.3, 0.2}, false});
  GivenBytes given = kGiven;
  given.emplace_back();
  Marks keep{0, 0, 0, 0, 1, 1};
  two.most_bytes = 5'100'000;
  swap_pairs(two, given, keep);
  EXPECT_EQ(keep, (Marks{0, 0, 0, 0, 1, 1}));
}

TEST(RungGaps, ALimitThatIsExceededAlreadyIsNotExceededMore) {
  TextureRungs one = kLadder;
  one.most_bytes = 1;
  Marks keep{1, 0, 1, 0, 1};
  const double before = bytes_of(one, keep);
  swap_pairs(one, kGiven, keep);
  EXPECT_LE(bytes_of(one, keep), before);
  EXPECT_EQ(keep[4], 1);
}

}  // namespace texmesh::rung_gaps_test
