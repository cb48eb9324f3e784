#include "stages/zim/zim.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/base/run_context.h"
#include "tests/support/meshes.h"

namespace texmesh::zim_test {

using testing::Random;

/// Two fragments of 16 x 16 side by side, all covered.
struct Plane {
  Fragments fragments;
  std::vector<Pixels> pixels;
};

Plane make_plane(std::uint32_t channels, auto&& value) {
  TexturePlane p;
  p.channels = channels;
  p.width_px = 32;
  p.height_px = 16;
  p.fragment_width_px = p.fragment_height_px = 16;
  p.columns = 2;
  p.rows = 1;
  p.coverage.assign(4 * 16, 0xff);
  p.covered_texels = {256, 256};
  p.eta = {0, 1};
  Pixels pixels{32, 16, channels, {}};
  for (std::uint32_t y = 0; y < 16; ++y)
    for (std::uint32_t x = 0; x < 32; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        pixels.data.push_back(static_cast<std::uint8_t>(value(x, y, c)));
  Plane out;
  out.fragments.planes = {p};
  out.pixels = {pixels};
  return out;
}

PlanePredictors predict(const Plane& p, const ZimOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return predict_quality(p.fragments, p.pixels, options, context).planes[0];
}

TEST(Zim, FlatAndCheckerboard) {
  // Left flat 51; right a board of 0 and 255 in every channel.
  const auto out =
      predict(make_plane(3, [](auto x, auto y, auto) { return x < 16 ? 51 : (x + y) % 2 * 255; }));
  EXPECT_FLOAT_EQ(out.z[0], 0);
  EXPECT_FLOAT_EQ(out.i[0], 0.2f);
  EXPECT_FLOAT_EQ(out.zeta[0], 0);
  EXPECT_FLOAT_EQ(out.m[0], 1 - 0.5f * 0.8f);
  EXPECT_FLOAT_EQ(out.z[1], 1);
  EXPECT_FLOAT_EQ(out.i[1], 0.5f);
  EXPECT_FLOAT_EQ(out.zeta[1], 1);
  EXPECT_FLOAT_EQ(out.m[1], 1 - (0.25f + 0.5f));
  // eta, Z and I are highest on the right, M on the left; equal weights.
  EXPECT_FLOAT_EQ(out.vqp[0], 0.25f);
  EXPECT_FLOAT_EQ(out.vqp[1], 0.75f);
}

TEST(Zim, GreyIsThreeEqualChannels) {
  const auto value = [](std::uint32_t x, std::uint32_t y, std::uint32_t) {
    return (x * x * 7 + y * 13) % 256;
  };
  const auto grey = predict(make_plane(1, value)), colour = predict(make_plane(3, value));
  EXPECT_FLOAT_EQ(grey.z[0], colour.z[0]);
  EXPECT_FLOAT_EQ(grey.i[1], colour.i[1]);
  EXPECT_FLOAT_EQ(grey.zeta[1], colour.zeta[1]);
}

TEST(Zim, AgainstTheFormulasOnAWholeFragment) {
  Random random{4};
  const Plane p = make_plane(3, [&](auto, auto, auto) { return random.next() % 256; });
  const auto out = predict(p);
  double sd = 0, mean = 0;
  for (std::uint32_t c = 0; c < 3; ++c) {
    double m = 0, v = 0;
    for (std::uint32_t k = 0; k < 256; ++k) m += p.pixels[0].at(k % 16, k / 16)[c] / 256.0;
    for (std::uint32_t k = 0; k < 256; ++k) v += std::pow(p.pixels[0].at(k % 16, k / 16)[c] - m, 2) / 256;
    sd += std::sqrt(v);
    mean += m / 3;
  }
  int different = 0;
  for (std::uint32_t y = 0; y < 15; ++y)
    for (std::uint32_t x = 0; x < 15; ++x)
      for (const auto& [dx, dy] : {std::array{1u, 0u}, {0u, 1u}}) {
        bool far = false;
        for (int c = 0; c < 3; ++c)
          far = far || std::abs(p.pixels[0].at(x, y)[c] - p.pixels[0].at(x + dx, y + dy)[c]) >= 24;
        different += far;
      }
  EXPECT_NEAR(out.z[0], sd / 382.5, 1e-6);
  EXPECT_NEAR(out.i[0], mean / 255, 1e-6);
  EXPECT_NEAR(out.zeta[0], different / (2.0 * 15 * 15), 1e-6);
}

TEST(Zim, OnlyCoveredTexelsCount) {
  Random random{6};
  Plane p = make_plane(3, [](auto x, auto y, auto) { return (x * 3 + y * 5) % 200; });
  TexturePlane& plane = p.fragments.planes[0];
  for (std::uint32_t y = 0; y < 16; ++y) plane.coverage[y * 4] = y < 8 ? 0xf0 : 0x00;
  plane.covered_texels[0] = 8 * 4 + 16 * 8;
  const auto before = predict(p);
  for (std::uint32_t y = 0; y < 16; ++y)
    for (std::uint32_t x = y < 8 ? 4 : 0; x < 8; ++x)
      for (int c = 0; c < 3; ++c)
        p.pixels[0].data[(y * 32 + x) * 3 + static_cast<std::uint32_t>(c)] =
            static_cast<std::uint8_t>(random.next());
  const auto after = predict(p);
  EXPECT_EQ(before.z, after.z);
  EXPECT_EQ(before.i, after.i);
  EXPECT_EQ(before.zeta, after.zeta);
  EXPECT_EQ(before.vqp, after.vqp);
  plane.covered_texels[0] = 0;
  std::fill(plane.coverage.begin(), plane.coverage.end(), std::uint8_t{0});
  plane.covered_texels[1] = 0;
  const auto none = predict(p);
  EXPECT_EQ(none.i, (std::vector<float>{0, 0}));
  EXPECT_EQ(none.vqp, (std::vector<float>{0, 0}));
}

TEST(Zim, TheSpreadIsThatOfCoveredFragments) {
  Plane p = make_plane(1, [](auto x, auto y, auto) { return x < 16 ? 250 : y < 8 ? 225 : 200; });
  TexturePlane& plane = p.fragments.planes[0];
  plane.fragment_height_px = 8;
  plane.rows = 2;
  plane.covered_texels = {128, 128, 0, 128};  // bright, but for the one that is not there
  plane.eta = {0, 0, 0, 0};
  for (std::size_t k = 8 * 4; k < 16 * 4; ++k)
    if (k % 4 < 2) plane.coverage[k] = 0;
  const std::vector<float> vqp =
      predict(p, {.weight_eta = 0, .weight_z = 0, .weight_i = 1, .weight_m = 0}).vqp;
  EXPECT_FLOAT_EQ(vqp[0], 1);
  EXPECT_NEAR(vqp[1], 0.5f, 1e-6);
  EXPECT_FLOAT_EQ(vqp[2], 0);
  EXPECT_FLOAT_EQ(vqp[3], 0);
}

TEST(Zim, ThresholdAndWeights) {
  const Plane p = make_plane(3, [](auto x, auto, auto c) { return c == 1 ? x % 2 * 24 : 100; });
  ZimOptions options;
  EXPECT_FLOAT_EQ(predict(p, options).zeta[0], 0.5f);  // east neighbours differ, south ones do not
  options.difference = 25;
  EXPECT_FLOAT_EQ(predict(p, options).zeta[0], 0);
  options = {.weight_eta = 7, .weight_z = 0, .weight_i = 0, .weight_m = 0};
  EXPECT_EQ(predict(p, options).vqp, (std::vector<float>{0, 1}));
  options.weight_eta = 0;
  EXPECT_THROW(predict(p, options), StageError);
}

TEST(Zim, WeightsAreRelativeToTheirSum) {
  // Left brighter and flat, right darker and a board: eta and Z are highest on the right, I and M on the
  // left.
  const Plane p = make_plane(3, [](auto x, auto y, auto) { return x < 16 ? 200 : (x + y) % 2 * 100; });
  const auto right = [&](double eta, double z, double i, double m) {
    return predict(p, {.weight_eta = eta, .weight_z = z, .weight_i = i, .weight_m = m}).vqp[1];
  };
  EXPECT_FLOAT_EQ(right(1, 1, 1, 1), 0.5f);
  EXPECT_FLOAT_EQ(right(3, 0, 1, 0), 0.75f);
  EXPECT_FLOAT_EQ(right(0, 1, 0, 3), 0.25f);
  EXPECT_FLOAT_EQ(right(0, 0.5, 0, 0), 1.0f);
}

TEST(Zim, DifferingTexelsAreThoseOfThePairs) {
  // Left flat; right stripes of two columns: every second column differs from its east neighbour.
  const Plane p = make_plane(1, [](auto x, auto, auto) { return x < 16 ? 51 : x / 2 % 2 * 100; });
  const std::vector<std::uint8_t> map = differing_texels(p.fragments.planes[0], p.pixels[0], {});
  ASSERT_EQ(map.size(), 32u * 16);
  for (std::uint32_t y = 0; y < 16; ++y)
    for (std::uint32_t x = 0; x < 32; ++x)
      EXPECT_EQ(map[y * 32 + x], x >= 16 && x % 2 == 1 && x < 31 && y < 15) << x << " " << y;
  // One pair a marked texel: 7 of 15 texels of a row, of two pairs each.
  EXPECT_FLOAT_EQ(predict(p).zeta[1], 7.0f / 30);
  Plane bad = p;
  bad.pixels[0].data.pop_back();
  EXPECT_THROW(differing_texels(bad.fragments.planes[0], bad.pixels[0], {}), StageError);
}

TEST(Zim, SameResultForAnyNumberOfThreadsAndBadInputIsRefused) {
  Random random{8};
  Plane p = make_plane(3, [&](auto, auto, auto) { return random.next() % 256; });
  const auto one = predict(p, {}, 1), eight = predict(p, {}, 8);
  EXPECT_EQ(one.z, eight.z);
  EXPECT_EQ(one.vqp, eight.vqp);
  p.fragments.planes[0].covered_texels[0] = 255;
  EXPECT_THROW(predict(p), StageError);
  p.fragments.planes[0].coverage.pop_back();
  EXPECT_THROW(predict(p), StageError);
  p.pixels.clear();
  EXPECT_THROW(predict(p), StageError);
  EXPECT_TRUE(predict_quality({}, {}, {}, {}).planes.empty());
}

}  // namespace texmesh::zim_test
