#include "stages/ladder/choose_rungs.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <numeric>

#include "stages/image/halve_pixels.h"
#include "stages/ladder/ladder.h"
#include "stages/ladder/rung_loss.h"
#include "stages/previews/previews.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

/// A full-size plane of 512 x 384 px and its mip, in fragments of 64 px.
struct Chain {
  Fragments fragments;
  std::vector<Pixels> pixels;
  Previews previews() const { return make_previews(fragments, pixels, {}, RunContext{}); }
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

Ladder encode(const Chain& chain, double gain, int threads = 1, LadderMode mode = LadderMode::kJpeg) {
  LadderOptions options;
  options.mode = mode;
  options.hull_gain = gain;
  options.normal_rungs = options.rungs;  // as low as those of colours
  RunContext context;
  context.threads = threads;
  return encode_ladder(chain.fragments, chain.pixels, chain.previews(), {}, options, context);
}

constexpr double kKeepAll = -1;

TEST(ChooseRungs, LossFallsAlongTheFullSizeAndBytesAreWhatIsStored) {
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

TEST(ChooseRungs, TheSampleShowsAllThatIsMeasuredAndItsBytesStandForThePlanes) {
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

TEST(ChooseRungs, AMipWhoseSampleShowsNothingIsSampledWhole) {
  Chain chain = make_chain(false);
  std::fill(chain.fragments.planes[1].covered_texels.begin(), chain.fragments.planes[1].covered_texels.end(),
            0u);
  chain.fragments.planes[1].covered_texels[0] = 1;
  std::fill(chain.fragments.planes[1].coverage.begin(), chain.fragments.planes[1].coverage.end(),
            std::uint8_t{0});
  EXPECT_EQ(hull_sample(chain.fragments)[1], std::vector<std::uint8_t>(12, 1));
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

TEST(ChooseRungs, WindowsWeighAsTheSurfaceOfTheirFragments) {
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
