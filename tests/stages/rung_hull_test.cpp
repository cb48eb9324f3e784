#include "stages/rung_hull.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "stages/halve_pixels.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

using Keep = std::vector<std::uint8_t>;

TEST(NearHull, NothingIsKeptOfNothing) { EXPECT_TRUE(near_hull({}, 0.1).empty()); }

TEST(NearHull, KeepsWhatNoMixtureOfOthersBeats) {
  const std::vector<RungPair> pairs{{0, 0, 100, 0.8}, {0, 1, 400, 0.1}, {0, 2, 1000, 0.0},
                                    {1, 0, 50, 0.5},  {1, 1, 90, 0.3},  {1, 2, 300, 0.29}};
  EXPECT_EQ(near_hull(pairs, 0), (Keep{1, 1, 1, 1, 1, 0}));
}

TEST(NearHull, ToleranceLetsNeighboursOfTheHullIn) {
  // At 200 bytes the hull between (90, 0.3) and (400, 0.1) is 0.229: 1.1 times that is above 0.25, 1.05 times
  // is below it.
  const std::vector<RungPair> pairs{{0, 0, 400, 0.1}, {0, 1, 1000, 0}, {1, 0, 90, 0.3}, {1, 1, 200, 0.25}};
  EXPECT_EQ(near_hull(pairs, 0.05), (Keep{1, 1, 1, 0}));
  EXPECT_EQ(near_hull(pairs, 0.10), (Keep{1, 1, 1, 1}));
}

TEST(NearHull, FullSizeKeepsEveryRung) {
  const std::vector<RungPair> pairs{{0, 0, 100, 0.9}, {0, 1, 200, 0.2}, {0, 2, 300, 0.199},
                                    {0, 3, 900, 0},   {1, 0, 50, 0.5},  {1, 1, 60, 0.49}};
  EXPECT_EQ(near_hull(pairs, 0), (Keep{1, 1, 1, 1, 1, 0}));
}

TEST(NearHull, EveryPlaneKeepsARung) {
  const std::vector<RungPair> pairs{{0, 0, 10, 0.1}, {0, 1, 20, 0}, {1, 0, 15, 0.4}, {1, 1, 30, 0.3}};
  const Keep keep = near_hull(pairs, 0);
  EXPECT_EQ(keep[0] + keep[1], 2);
  EXPECT_EQ(keep[2] + keep[3], 1);
}

TEST(NearHull, PairsEqualToOneOnTheHullAreOnIt) {
  const std::vector<RungPair> pairs{{0, 0, 10, 0.5}, {0, 1, 20, 0.1}, {1, 0, 10, 0.5}, {1, 1, 20, 0.1}};
  EXPECT_EQ(near_hull(pairs, 0), (Keep{1, 1, 1, 1}));
}

/// A full-size plane of 512 x 384 px and its mip, in fragments of 64 px.
struct Chain {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

Pixels shades(std::uint32_t width, std::uint32_t height, bool noise) {
  Pixels out{width, height, 3, {}};
  testing::Random random{7};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < 3; ++c)
        out.data.push_back(static_cast<std::uint8_t>(
            noise ? random.next() & 255 : (x * (c + 1) / 5 + y / 3 + ((x / 64 + y / 48) % 2) * 40) & 255));
  return out;
}

TexturePlane plane_of(const Pixels& pixels) {
  TexturePlane plane;
  plane.width_px = pixels.width_px;
  plane.height_px = pixels.height_px;
  plane.fragment_width_px = plane.fragment_height_px = 64;
  plane.columns = pixels.width_px / 64;
  plane.rows = pixels.height_px / 64;
  plane.coverage.assign(std::size_t{pixels.width_px} / 8 * pixels.height_px, 0xff);
  plane.covered_texels.assign(plane.fragment_count(), 64 * 64);
  plane.surface_fraction.assign(plane.fragment_count(), 1.0f / static_cast<float>(plane.fragment_count()));
  return plane;
}

Chain make_chain(bool noise, bool with_mip = true) {
  Chain out;
  out.pixels.push_back(shades(512, 384, noise));
  out.fragments.planes.push_back(plane_of(out.pixels[0]));
  if (!with_mip) return out;
  out.pixels.push_back(halved(out.pixels[0], 512, 384, Halving::kLight));
  out.fragments.planes.push_back(plane_of(out.pixels[1]));
  out.fragments.planes[1].mip = 1;
  return out;
}

Ladder encode(const Chain& chain, double tolerance, int threads = 1, LadderMode mode = LadderMode::kJpeg) {
  LadderOptions options;
  options.mode = mode;
  options.hull_tolerance = tolerance;
  RunContext context;
  context.threads = threads;
  return encode_ladder(chain.fragments, chain.pixels, options, context);
}

constexpr double kKeepAll = 1e9;

TEST(RungHull, LossFallsAlongTheFullSizeAndBytesAreWhatIsStored) {
  const Chain chain = make_chain(false);
  const Ladder ladder = encode(chain, kKeepAll);
  ASSERT_EQ(ladder.planes[1].rungs.size(), LadderOptions{}.rungs.size());
  const auto pairs = measure_pairs(chain.fragments, chain.pixels, ladder, 0, RunContext{});
  ASSERT_EQ(pairs.size(), 20u);
  for (const RungPair& pair : pairs) {
    const LadderRung& rung = ladder.planes[pair.level].rungs[pair.rung];
    EXPECT_EQ(pair.bytes, rung.data.size() + rung.tables.size());
  }
  EXPECT_GT(pairs[0].loss, pairs[9].loss);
  EXPECT_LT(pairs[9].loss, 0.02);
  EXPECT_GT(pairs[19].loss, pairs[9].loss);  // a mip never shows all of it
}

TEST(RungHull, NoiseThatAMipCannotShowLeavesItOneOrFewRungs) {
  const Chain chain = make_chain(true);
  const Ladder ladder = encode(chain, 0);
  EXPECT_LT(ladder.planes[1].rungs.size(), 5u);
  EXPECT_GE(ladder.planes[1].rungs.size(), 1u);
  EXPECT_EQ(ladder.planes[0].rungs.size(), LadderOptions{}.rungs.size());
}

TEST(RungHull, KeptRungsAreTheirWholeSelves) {
  const Chain chain = make_chain(false);
  const Ladder all = encode(chain, kKeepAll), some = encode(chain, 0);
  std::size_t dropped = 0;
  for (std::size_t p = 0; p < 2; ++p) {
    dropped += all.planes[p].rungs.size() - some.planes[p].rungs.size();
    for (const LadderRung& rung : some.planes[p].rungs) {
      const auto same = std::find_if(all.planes[p].rungs.begin(), all.planes[p].rungs.end(),
                                     [&](const LadderRung& r) { return r.quality == rung.quality; });
      ASSERT_NE(same, all.planes[p].rungs.end());
      EXPECT_EQ(same->data, rung.data);
      EXPECT_EQ(same->tables, rung.tables);
    }
  }
  EXPECT_GT(dropped, 0u);
}

TEST(RungHull, WithoutMipsNothingIsDropped) {
  const Chain chain = make_chain(true, false);
  EXPECT_EQ(encode(chain, 0).planes[0].rungs.size(), LadderOptions{}.rungs.size());
}

TEST(RungHull, SameForAnyNumberOfThreads) {
  const Chain chain = make_chain(false);
  const Ladder one = encode(chain, 0.1, 1), many = encode(chain, 0.1, 8);
  for (std::size_t p = 0; p < 2; ++p) {
    ASSERT_EQ(one.planes[p].rungs.size(), many.planes[p].rungs.size());
    for (std::size_t r = 0; r < one.planes[p].rungs.size(); ++r)
      EXPECT_EQ(one.planes[p].rungs[r].data, many.planes[p].rungs[r].data);
  }
}

TEST(RungHull, APlaneWithoutCoveredFragmentsKeepsARung) {
  Chain chain = make_chain(false);
  for (TexturePlane& plane : chain.fragments.planes) {
    std::fill(plane.coverage.begin(), plane.coverage.end(), std::uint8_t{0});
    std::fill(plane.covered_texels.begin(), plane.covered_texels.end(), 0u);
  }
  const Ladder ladder = encode(chain, 0.1);
  for (const PlaneLadder& plane : ladder.planes) EXPECT_GE(plane.rungs.size(), 1u);
}

}  // namespace
}  // namespace texmesh
