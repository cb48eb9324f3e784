#include "stages/ladder/choose_rungs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "tests/stages/ladder/mip_chain.h"

namespace texmesh::rung_loss_test {

using testing::Chain;
using testing::encode;
using testing::make_chain;
using testing::rungs_of;

TEST(RungLoss, LossFallsAlongEveryPlaneAndBytesAreWhatIsStored) {
  const Chain chain = make_chain(false);
  const Ladder ladder = encode(chain, false);
  ASSERT_EQ(ladder.planes[1].rungs.size(), LadderOptions{}.rungs.size());
  const TextureRungs texture = rungs_of(chain, ladder);
  ASSERT_EQ(texture.pairs.size(), 20u);
  ASSERT_EQ(texture.preview_loss.size(), 2u);
  for (const RungPair& pair : texture.pairs) {
    const LadderRung& rung = ladder.planes[pair.level].rungs[pair.rung];
    EXPECT_EQ(pair.bytes, rung.data.size() + rung.table_stream.size());
    EXPECT_EQ(pair.loss.size(), pair.level + 1);
    EXPECT_FALSE(pair.fixed);
  }
  EXPECT_GT(texture.pairs[0].loss[0], texture.pairs[9].loss[0]);
  EXPECT_LT(texture.pairs[9].loss[0], 0.02);
  EXPECT_GT(texture.pairs[19].loss[0], texture.pairs[9].loss[0]);  // a mip never shows all of it
  EXPECT_LT(texture.pairs[19].loss[1], 0.02);                      // but all of itself
  EXPECT_GT(texture.preview_loss[0], texture.pairs[9].loss[0]);
}

TEST(RungLoss, ATextureIsAsLargeAsItsTexelsOnABall) {
  const Chain chain = make_chain(false);
  const TextureRungs texture = rungs_of(chain, encode(chain, false));
  EXPECT_NEAR(texture.surface, 1, 1e-5);
  EXPECT_NEAR(texture.texels_across, std::sqrt(512 * 384 / 3.14159265), 0.01);
}

TEST(RungLoss, ColoursAloneCloseGaps) {
  Chain chain = make_chain(false, false);
  const Ladder ladder = encode(chain, false);
  for (const auto& [role, closes] :
       {std::pair{TextureRole::kBaseColour, true}, std::pair{TextureRole::kEmissive, true},
        std::pair{TextureRole::kNormal, false}, std::pair{TextureRole::kOcclusionRoughnessMetallic, false}}) {
    chain.fragments.planes[0].role = role;
    EXPECT_EQ(rungs_of(chain, ladder).closes_gaps, closes) << static_cast<int>(role);
  }
}

TEST(RungLoss, TheSourcesOwnRungIsFixed) {
  const Chain chain = make_chain(false);
  Ladder ladder = encode(chain, false);
  ladder.planes[0].source_rung = true;
  const TextureRungs texture = rungs_of(chain, ladder);
  for (std::size_t k = 0; k < texture.pairs.size(); ++k) EXPECT_EQ(texture.pairs[k].fixed, k == 9) << k;
}

/// The ladder with nothing but the marked fragments.
Ladder only(const Ladder& ladder, const std::vector<std::vector<std::uint8_t>>& marks) {
  Ladder out = ladder;
  for (std::size_t p = 0; p < out.planes.size(); ++p)
    for (std::size_t r = 0; r < out.planes[p].rungs.size(); ++r) {
      LadderRung& rung = out.planes[p].rungs[r];
      rung.data.clear();
      rung.offset = {0};
      for (std::size_t f = 0; f < marks[p].size(); ++f) {
        const auto stream = fragment_stream(ladder.planes[p].rungs[r], f);
        if (marks[p][f]) rung.data.insert(rung.data.end(), stream.begin(), stream.end());
        rung.offset.push_back(rung.data.size());
      }
    }
  return out;
}

TEST(RungLoss, TheSampleShowsAllThatIsMeasuredAndItsBytesStandForThePlanes) {
  const Chain chain = make_chain(false);
  const auto marks = choice_sample(chain.fragments);
  ASSERT_EQ(marks.size(), 2u);
  EXPECT_EQ(std::count(marks[0].begin(), marks[0].end(), 1), 6);
  const Ladder all = encode(chain, false), some = only(all, marks);
  const TextureRungs want = rungs_of(chain, all), got = rungs_of(chain, some);
  EXPECT_EQ(want.preview_loss, got.preview_loss);
  ASSERT_EQ(want.pairs.size(), got.pairs.size());
  for (std::size_t k = 0; k < want.pairs.size(); ++k) {
    EXPECT_EQ(want.pairs[k].loss, got.pairs[k].loss) << k;
    EXPECT_NEAR(static_cast<double>(got.pairs[k].bytes), static_cast<double>(want.pairs[k].bytes),
                0.3 * static_cast<double>(want.pairs[k].bytes))
        << k;
  }
}

TEST(RungLoss, AMipWhoseSampleShowsNothingIsSampledWhole) {
  Chain chain = make_chain(false);
  std::fill(chain.fragments.planes[1].covered_texels.begin(), chain.fragments.planes[1].covered_texels.end(),
            0u);
  chain.fragments.planes[1].covered_texels[0] = 1;
  std::fill(chain.fragments.planes[1].coverage.begin(), chain.fragments.planes[1].coverage.end(),
            std::uint8_t{0});
  EXPECT_EQ(choice_sample(chain.fragments)[1], std::vector<std::uint8_t>(12, 1));
}

TEST(RungLoss, WindowsWeighAsTheSurfaceOfTheirFragments) {
  // Of 48 fragments every eighth from the fifth on has a window. Noise in one of them, which is all of the
  // surface or none of it.
  Chain chain = make_chain(false, false);
  TexturePlane& plane = chain.fragments.planes[0];
  constexpr std::size_t kNoisy = 20, kOther = 44;
  testing::Random random{3};
  std::fill(chain.pixels[0].data.begin(), chain.pixels[0].data.end(), std::uint8_t{100});
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 0; x < 64 * 3; ++x)
      chain.pixels[0].data[((kNoisy / 8 * 64 + y) * 512 + kNoisy % 8 * 64) * 3 + x] =
          static_cast<std::uint8_t>(random.next());
  const Ladder ladder = encode(chain, false);
  const auto losses = [&](std::size_t seen) {
    std::fill(plane.surface_fraction.begin(), plane.surface_fraction.end(), 0.0f);
    plane.surface_fraction[seen] = 1;
    const TextureRungs texture = rungs_of(chain, ladder);
    return std::array{texture.pairs[0].loss[0], texture.preview_loss[0]};
  };
  for (const double loss : losses(kNoisy)) EXPECT_GT(loss, 0.3);
  for (const double loss : losses(kOther)) EXPECT_LT(loss, 0.01);
}

}  // namespace texmesh::rung_loss_test
