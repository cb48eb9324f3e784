
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "format/documents/tables.h"
#include "format/rules/size_curve.h"
#include "stages/base/run_context.h"
#include "stages/jpeg/jpeg.h"
#include "stages/ladder/ladder.h"
#include "stages/lut/lut.h"
#include "stages/previews/previews.h"
#include "stages/zim/zim.h"
#include "tests/support/all_rungs.h"
#include "tests/support/meshes.h"

namespace texmesh::size_knots_test {

constexpr std::uint32_t kSide = 256, kFragment = 64;

struct Plane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

/// Shades, edges and grain that a JPEG of quality 80 has been before. A corner is not covered.
Plane make_plane() {
  testing::Random random{7};
  Pixels pixels{kSide, kSide, 3, {}};
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x)
      for (std::uint32_t c = 0; c < 3; ++c)
        pixels.data.push_back(static_cast<std::uint8_t>(
            90 + (x * 3 + y * 2 + c * 40) % 67 + ((x / 23 + y / 17) % 3 == 0 ? 50 : 0) + random.next() % 24));
  TexturePlane plane;
  plane.role = TextureRole::kBaseColour;
  plane.channels = 3;
  plane.columns = plane.rows = kSide / kFragment;
  plane.fragment_width_px = plane.fragment_height_px = kFragment;
  plane.width_px = plane.height_px = kSide;
  plane.covered_texels.assign(plane.fragment_count(), kFragment * kFragment);
  plane.surface_fraction.assign(plane.fragment_count(), 1.0f / 16);
  plane.eta.assign(plane.fragment_count(), 0);
  plane.features.assign(plane.fragment_count(), 0);
  plane.coverage.assign(kSide * kSide / 8, 255);
  for (std::size_t y = 0; y < 40; ++y) plane.coverage[y * kSide / 8] = 0;
  plane.covered_texels[0] -= 40 * 8;
  Plane out;
  out.fragments.planes.push_back(plane);
  out.pixels.push_back(decode_jpeg(encode_jpeg(pixels, 80, Subsampling::k444), 1 << 20));
  return out;
}

Ladder encode(const Plane& p, const LadderOptions& options, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return encode_ladder(p.fragments, p.pixels, {}, {}, options, context);
}

LadderOptions rungs(std::vector<int> qualities) {
  LadderOptions options = testing::all_rungs();
  options.rungs = std::move(qualities);
  return options;
}

PlaneTables tables_of(const Plane& p, const Ladder& ladder) {
  return build_tables(p.fragments, p.pixels, predict_quality(p.fragments, p.pixels, {}, {}), ladder,
                      make_previews(p.fragments, p.pixels, {}, {}), {}, {})
      .tables.planes[0];
}

/// Mean error of the whole plane's bytes at the rungs of another ladder.
double mean_error(const PlaneTables& t, const Ladder& other) {
  double sum = 0;
  for (const LadderRung& rung : other.planes[0].rungs) {
    double guess = 0;
    for (const std::uint16_t f : t.order) guess += interpolated_bytes(t, f, rung.quality);
    sum += std::fabs(guess / static_cast<double>(rung.data.size()) - 1);
  }
  return sum / static_cast<double>(other.planes[0].rungs.size());
}

TEST(SizeKnots, FollowWhatTheSourcesQuantisersLeft) {
  const Plane p = make_plane();
  const PlaneTables t = tables_of(p, encode(p, rungs({30, 53, 75, 93})));
  PlaneTables plain = t;
  plain.knot_quality.clear();
  plain.knot_position.clear();
  ASSERT_FALSE(t.knot_quality.empty());
  const Ladder other = encode(p, rungs({38, 43, 48, 57, 60, 63, 69, 77, 80, 84, 88}));
  const double with = mean_error(t, other), without = mean_error(plain, other);
  EXPECT_GT(without, 0.02);  // else this says nothing
  EXPECT_LT(with, 0.01);
  EXPECT_LT(with, without / 3);
}

TEST(SizeKnots, LieBetweenRungsAndPassTheTables) {
  const Plane p = make_plane();
  const Ladder ladder = encode(p, rungs({5, 6, 8, 30, 97}));
  const SizeKnots& knots = ladder.planes[0].knots;
  ASSERT_EQ(knots.quality.size(), knots.position.size());
  EXPECT_EQ(knots.quality.front(), 7);  // none between 5 and 6
  EXPECT_EQ(knots.quality.size(), 1u + 21 + 66);
  const PlaneTables t = tables_of(p, ladder);
  EXPECT_EQ(t.knot_quality, knots.quality);
  EXPECT_EQ(t.knot_position, knots.position);
  EXPECT_EQ(read_tables(write_tables({{t}})).planes[0].knot_quality, knots.quality);
}

TEST(SizeKnots, OnlyOfFullSizeColoursInBaselineFiles) {
  const auto none = [](auto change) {
    Plane p = make_plane();
    LadderOptions options = testing::all_rungs();
    change(p, options);
    for (const PlaneLadder& plane : encode(p, options).planes) EXPECT_TRUE(plane.knots.quality.empty());
  };
  none([](Plane& p, LadderOptions&) { p.fragments.planes[0].role = TextureRole::kNormal; });
  none([](Plane& p, LadderOptions&) { std::fill_n(p.fragments.planes[0].covered_texels.begin(), 16, 0u); });
  none([](Plane&, LadderOptions& options) { options.mode = LadderMode::kWebp; });
  none([](Plane&, LadderOptions& options) { options.rungs = {75}; });
  none([](Plane&, LadderOptions& options) { options.rungs = {75, 76}; });
}

TEST(SizeKnots, SameForAnyNumberOfThreads) {
  const Plane p = make_plane();
  const SizeKnots one = encode(p, testing::all_rungs(), 1).planes[0].knots,
                  eight = encode(p, testing::all_rungs(), 8).planes[0].knots;
  EXPECT_EQ(one.quality, eight.quality);
  EXPECT_EQ(one.position, eight.position);
}

}  // namespace texmesh::size_knots_test
