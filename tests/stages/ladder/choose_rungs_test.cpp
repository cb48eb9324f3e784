#include "stages/ladder/choose_rungs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <numeric>

#include "stages/fragment_codec/fragment_codec.h"
#include "stages/image/decode_image.h"
#include "stages/jpeg/jpeg.h"
#include "tests/stages/ladder/mip_chain.h"

namespace texmesh::choose_rungs_test {

using testing::Chain;
using testing::encode;
using testing::make_chain;
using testing::rungs_of;

constexpr std::size_t kAll = 10;  // rungs of colours by default

TEST(ChooseRungs, EveryPlaneHasFewerRungsThanAreTriedAndAtLeastOne) {
  for (const bool noise : {false, true})
    for (const bool with_mip : {false, true}) {
      const Ladder ladder = encode(make_chain(noise, with_mip), true);
      for (const PlaneLadder& plane : ladder.planes) {
        EXPECT_LT(plane.rungs.size(), kAll);
        EXPECT_GE(plane.rungs.size(), 1u);
      }
    }
}

TEST(ChooseRungs, KeptRungsAreTheirWholeSelves) {
  const Chain chain = make_chain(false);
  const Ladder all = encode(chain, false), some = encode(chain, true);
  for (std::size_t p = 0; p < 2; ++p) {
    ASSERT_EQ(all.planes[p].rungs.size(), kAll);
    for (const LadderRung& rung : some.planes[p].rungs) {
      const auto same = std::find_if(all.planes[p].rungs.begin(), all.planes[p].rungs.end(),
                                     [&](const LadderRung& r) { return r.quality == rung.quality; });
      ASSERT_NE(same, all.planes[p].rungs.end());
      EXPECT_EQ(same->data, rung.data);
      EXPECT_EQ(same->table_stream, rung.table_stream);
    }
  }
}

TEST(ChooseRungs, NoRungIsWorseThanThePreviewOrThanACheaperOne) {
  const Chain chain = make_chain(false);
  const TextureRungs texture = rungs_of(chain, encode(chain, true));
  for (std::size_t k = 0; k < texture.pairs.size(); ++k) {
    const RungPair& pair = texture.pairs[k];
    EXPECT_LT(pair.loss[pair.level], texture.preview_loss[pair.level]) << k;
    if (k == 0 || texture.pairs[k - 1].level != pair.level) continue;
    EXPECT_LT(texture.pairs[k - 1].bytes, pair.bytes) << k;
    EXPECT_GT(texture.pairs[k - 1].loss[pair.level], pair.loss[pair.level]) << k;
  }
}

TEST(ChooseRungs, AMipHasARungThatShowsItWell) {
  const Chain chain = make_chain(false);
  EXPECT_LE(rungs_of(chain, encode(chain, true)).pairs.back().loss[1], 0.02);
}

TEST(ChooseRungs, TheSourcesOwnCoefficientsStay) {
  const Chain chain = make_chain(false);
  Ladder ladder = encode(chain, false);
  // Made as bad as a rung can be: nothing but the rule keeps it.
  ladder.planes[0].source_rung = true;
  ladder.planes[0].rungs.back().data = ladder.planes[0].rungs[0].data;
  ladder.planes[0].rungs.back().offset = ladder.planes[0].rungs[0].offset;
  ladder.planes[0].rungs.back().table_stream = ladder.planes[0].rungs[0].table_stream;
  const auto kept =
      choose_rungs(chain.fragments, chain.pixels, ladder.planes, chain.previews(), {}, RunContext{});
  EXPECT_EQ(kept[0].back(), kAll - 1);
  EXPECT_GT(kept[0].size(), 1u);
}

TEST(ChooseRungs, TheFinestRungOfASourceWithoutLossStaysUnlessItIsLargerThanTheSource) {
  const Chain chain = make_chain(false);
  Ladder ladder = encode(chain, false);
  LadderRung& last = ladder.planes[0].rungs.back();
  last = ladder.planes[0].rungs[0];  // nothing but the rule keeps it
  last.quality = kFinestQuality;
  const auto stays = [&](ImageFormat format, double times) {
    Image image;
    image.format = format;
    image.bytes.resize(static_cast<std::size_t>(times * static_cast<double>(last.data.size())));
    const std::vector<Image> images(2, image);
    const auto kept =
        choose_rungs(chain.fragments, chain.pixels, ladder.planes, chain.previews(), images, RunContext{});
    return kept[0].back() == kAll - 1;
  };
  EXPECT_TRUE(stays(ImageFormat::kPng, 2));
  EXPECT_FALSE(stays(ImageFormat::kPng, 0.5));
  EXPECT_FALSE(stays(ImageFormat::kWebp, 2));
}

TEST(ChooseRungs, IncrementalLaddersHaveNoGaps) {
  Chain chain = make_chain(false);
  Ladder ladder = encode(chain, false);
  for (PlaneLadder& plane : ladder.planes) plane.codec = Codec::kJpegProgressive;
  // What the rungs show does not matter here, only which of them are taken: every file is whole.
  for (PlaneLadder& plane : ladder.planes) {
    for (std::size_t r = plane.rungs.size(); r-- > 1;) plane.rungs[r].table_stream.clear();
    LadderRung whole = plane.rungs[0];
    for (LadderRung& rung : plane.rungs) rung.data.clear(), rung.offset.assign(whole.offset.size(), 0);
  }
  for (const auto& rungs :
       choose_rungs(chain.fragments, chain.pixels, ladder.planes, chain.previews(), {}, RunContext{})) {
    std::vector<std::size_t> want(rungs.size());
    std::iota(want.begin(), want.end(), std::size_t{0});
    EXPECT_EQ(rungs, want);
  }
}

TEST(ChooseRungs, SameForAnyNumberOfThreads) {
  const Chain chain = make_chain(false);
  const Ladder one = encode(chain, true, 1), many = encode(chain, true, 8);
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
  for (const PlaneLadder& plane : encode(chain, true).planes) EXPECT_EQ(plane.rungs.size(), 1u);
}

TEST(ChooseRungs, WithoutAPreviewThereIsNoChoice) {
  const Chain chain = make_chain(false);
  LadderOptions options;
  EXPECT_THROW(encode_ladder(chain.fragments, chain.pixels, {}, {}, options, RunContext{}), StageError);
  options.prune = false;
  EXPECT_EQ(encode_ladder(chain.fragments, chain.pixels, {}, {}, options, RunContext{}).planes.size(), 2u);
}

TEST(ChooseRungs, FewBytesOfJpegTryTheHighestRungsOfMips) {
  Chain chain = make_chain(false);
  const Bytes file = encode_jpeg(chain.pixels[0], 70, Subsampling::k420);
  ASSERT_LT(file.size(), 150'000u);
  const std::vector<Image> images{probe_image("a picture", file, {})};
  for (TexturePlane& plane : chain.fragments.planes) {  // partly covered blocks begin with the rung below
    plane.coverage.assign(plane.coverage.size(), 0x3c);
    plane.covered_texels.assign(plane.fragment_count(), 32 * 64);
  }
  const auto ladder_of = [&](std::vector<int> rungs) {
    LadderOptions options;
    options.rungs = std::move(rungs);
    return encode_ladder(chain.fragments, chain.pixels, chain.previews(), images, options, RunContext{});
  };
  const Ladder all = ladder_of({5, 8, 11, 18, 30, 53, 75, 86, 93, 97}), highest = ladder_of({86, 93, 97});
  EXPECT_EQ(all.planes[0].rungs.size(), 1u);
  ASSERT_EQ(all.planes[1].rungs.size(), highest.planes[1].rungs.size());
  for (std::size_t r = 0; r < all.planes[1].rungs.size(); ++r)
    EXPECT_EQ(all.planes[1].rungs[r].data, highest.planes[1].rungs[r].data);
}

}  // namespace texmesh::choose_rungs_test
