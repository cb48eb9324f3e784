#include "stages/ladder/rung_loss.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>

#include "tests/stages/ladder/mip_chain.h"

namespace texmesh {
namespace {

using testing::Chain;
using testing::encode;
using testing::kKeepAll;
using testing::make_chain;

TEST(RungLoss, LossFallsAlongTheFullSizeAndBytesAreWhatIsStored) {
  const Chain chain = make_chain(false);
  const Ladder ladder = encode(chain, kKeepAll);
  ASSERT_EQ(ladder.planes[1].rungs.size(), LadderOptions{}.rungs.size());
  const auto pairs = measure_pairs(chain.fragments, chain.pixels, ladder.planes, 0, RunContext{});
  ASSERT_EQ(pairs.size(), 20u);
  for (const RungPair& pair : pairs) {
    const LadderRung& rung = ladder.planes[pair.level].rungs[pair.rung];
    EXPECT_EQ(pair.bytes, rung.data.size() + rung.table_stream.size());
  }
  EXPECT_GT(pairs[0].loss, pairs[9].loss);
  EXPECT_LT(pairs[9].loss, 0.02);
  EXPECT_GT(pairs[19].loss, pairs[9].loss);  // a mip never shows all of it
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
  const auto marks = hull_sample(chain.fragments);
  ASSERT_EQ(marks.size(), 2u);
  EXPECT_EQ(std::count(marks[0].begin(), marks[0].end(), 1), 48);
  EXPECT_EQ(marks[1], (std::vector<std::uint8_t>{0, 1, 1, 1, 0, 1, 1, 1, 0, 1, 1, 1}));
  const Ladder all = encode(chain, kKeepAll), some = only(all, marks);
  const auto pairs_of = [&](const Ladder& ladder) {
    return measure_pairs(chain.fragments, chain.pixels, ladder.planes, 0, RunContext{});
  };
  const auto own_of = [&](const Ladder& ladder) {
    return measure_mip(chain.fragments.planes[1], chain.pixels[1], ladder.planes[1],
                       chain.previews().planes[0].file, RunContext{});
  };
  const auto expect_alike = [](const auto& want, const auto& got) {
    ASSERT_EQ(want.size(), got.size());
    for (std::size_t k = 0; k < want.size(); ++k) {
      EXPECT_EQ(want[k].loss, got[k].loss) << k;
      EXPECT_NEAR(static_cast<double>(got[k].bytes), static_cast<double>(want[k].bytes),
                  0.3 * static_cast<double>(want[k].bytes))
          << k;
    }
  };
  expect_alike(pairs_of(all), pairs_of(some));
  expect_alike(own_of(all), own_of(some));
}

TEST(RungLoss, AMipWhoseSampleShowsNothingIsSampledWhole) {
  Chain chain = make_chain(false);
  std::fill(chain.fragments.planes[1].covered_texels.begin(), chain.fragments.planes[1].covered_texels.end(),
            0u);
  chain.fragments.planes[1].covered_texels[0] = 1;
  std::fill(chain.fragments.planes[1].coverage.begin(), chain.fragments.planes[1].coverage.end(),
            std::uint8_t{0});
  EXPECT_EQ(hull_sample(chain.fragments)[1], std::vector<std::uint8_t>(12, 1));
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
  const Ladder ladder = encode(chain, kKeepAll);
  const auto losses = [&](std::size_t seen) {
    std::fill(plane.surface_fraction.begin(), plane.surface_fraction.end(), 0.0f);
    plane.surface_fraction[seen] = 1;
    return std::array{measure_pairs(chain.fragments, chain.pixels, ladder.planes, 0, RunContext{})[0].loss,
                      measure_mip(plane, chain.pixels[0], ladder.planes[0], chain.previews().planes[0].file,
                                  RunContext{})[0]
                          .loss};
  };
  for (const double loss : losses(kNoisy)) EXPECT_GT(loss, 0.3);
  for (const double loss : losses(kOther)) EXPECT_LT(loss, 0.01);
}

}  // namespace
}  // namespace texmesh
