#include "stages/ladder/choose_rungs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "stages/ladder/rung_loss.h"
#include "tests/stages/ladder/mip_chain.h"

namespace texmesh {
namespace {

using testing::Chain;
using testing::encode;
using testing::kKeepAll;
using testing::make_chain;

TEST(ChooseRungs, NoiseThatAMipCannotShowLeavesItFewRungs) {
  const Chain chain = make_chain(true);
  const Ladder ladder = encode(chain, 0);
  EXPECT_LT(ladder.planes[1].rungs.size(), 7u);
  EXPECT_GE(ladder.planes[1].rungs.size(), 1u);
  EXPECT_EQ(ladder.planes[0].rungs.size(), LadderOptions{}.rungs.size());
}

TEST(ChooseRungs, KeptRungsAreTheirWholeSelves) {
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
      EXPECT_EQ(same->table_stream, rung.table_stream);
    }
  }
  EXPECT_GT(dropped, 0u);
}

TEST(ChooseRungs, AMipHasARungThatShowsItWellAndNoneWorseThanThePreview) {
  const Chain chain = make_chain(false);
  const Ladder ladder = encode(chain, LadderOptions{}.hull_gain);
  ASSERT_LT(ladder.planes[1].rungs.size(), LadderOptions{}.rungs.size());
  const auto own = measure_mip(chain.fragments.planes[1], chain.pixels[1], ladder.planes[1],
                               chain.previews().planes[0].file, RunContext{});
  ASSERT_EQ(own.size(), ladder.planes[1].rungs.size() + 1);
  EXPECT_LE(own.back().loss, 0.02);
  for (std::size_t k = 1; k < own.size(); ++k) EXPECT_LT(own[k].loss, own[0].loss);
}

TEST(ChooseRungs, ColoursAndDataHaveTheirOwnLimitOfWhatShowsAMipWell) {
  for (const auto& [role, limit] :
       {std::pair{TextureRole::kBaseColour, 0.02}, {TextureRole::kNormal, 0.03}}) {
    Chain chain = make_chain(false);
    for (TexturePlane& plane : chain.fragments.planes) plane.role = role;
    const Ladder all = encode(chain, kKeepAll), some = encode(chain, 1e9);
    const auto own = measure_mip(chain.fragments.planes[1], chain.pixels[1], all.planes[1],
                                 chain.previews().planes[0].file, RunContext{});
    std::size_t first = 1;
    while (first + 1 < own.size() && own[first].loss > limit) ++first;
    ASSERT_GT(first, 1u);
    EXPECT_EQ(some.planes[1].rungs.back().quality, all.planes[1].rungs[first - 1].quality);
  }
}

TEST(ChooseRungs, WithoutMipsNothingIsDropped) {
  const Chain chain = make_chain(true, false);
  EXPECT_EQ(encode(chain, 0).planes[0].rungs.size(), LadderOptions{}.rungs.size());
}

TEST(ChooseRungs, SameForAnyNumberOfThreads) {
  const Chain chain = make_chain(false);
  const Ladder one = encode(chain, 0.01, 1), many = encode(chain, 0.01, 8);
  for (std::size_t p = 0; p < 2; ++p) {
    ASSERT_EQ(one.planes[p].rungs.size(), many.planes[p].rungs.size());
    for (std::size_t r = 0; r < one.planes[p].rungs.size(); ++r)
      EXPECT_EQ(one.planes[p].rungs[r].data, many.planes[p].rungs[r].data);
  }
}

TEST(ChooseRungs, APlaneWithoutCoveredFragmentsKeepsARung) {
  Chain chain = make_chain(false);
  for (TexturePlane& plane : chain.fragments.planes) {
    std::fill(plane.coverage.begin(), plane.coverage.end(), std::uint8_t{0});
    std::fill(plane.covered_texels.begin(), plane.covered_texels.end(), 0u);
  }
  const Ladder ladder = encode(chain, 0.01);
  for (const PlaneLadder& plane : ladder.planes) EXPECT_GE(plane.rungs.size(), 1u);
}

TEST(ChooseRungs, OfFullSizePlanesAll) {
  const Chain chain = make_chain(false);
  Ladder ladder = encode(chain, kKeepAll);
  const auto chosen = [&](double gain) {
    return choose_rungs(chain.fragments, chain.pixels, ladder.planes, chain.previews(), gain, RunContext{});
  };
  std::vector<std::size_t> all(10);
  std::iota(all.begin(), all.end(), std::size_t{0});
  EXPECT_EQ(chosen(kKeepAll), (std::vector{all, all}));
  const auto some = chosen(1e9);
  EXPECT_EQ(some[0], all);
  EXPECT_LT(some[1].size(), all.size());
}

}  // namespace
}  // namespace texmesh
