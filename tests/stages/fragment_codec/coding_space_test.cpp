#include "stages/fragment_codec/fragment_codec.h"

#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "stages/data/pixels.h"
#include "tests/support/meshes.h"

namespace texmesh::coding_space_test {

using testing::Random;

constexpr CodingSpace kApart{true, Subsampling::k444}, kYcc444{false, Subsampling::k444},
    kYcc420{false, Subsampling::k420};

constexpr std::uint32_t kSide = 256;

/// Smooth waves and some grain.
double waves(std::uint32_t x, std::uint32_t y, double length, Random& random) {
  return 60 * std::sin(x / length) * std::cos(y / (0.7 * length)) + random.next() % 8 - 4.0;
}

std::uint8_t byte(double value) { return static_cast<std::uint8_t>(std::clamp(value + 128.5, 0.0, 255.0)); }

/// Every channel has a picture of its own.
Pixels unrelated() {
  Pixels out{kSide, kSide, 3, {}};
  Random random{5};
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x)
      for (const double length : {3.0, 5.0, 7.0}) out.data.push_back(byte(waves(x, y, length, random)));
  return out;
}

/// One picture in all channels, and where `tint` is above 0 smooth shades of their own.
Pixels alike(double tint) {
  Pixels out{kSide, kSide, 3, {}};
  Random random{5};
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const double grey = waves(x, y, 3, random);
      for (int c = 0; c < 3; ++c) out.data.push_back(byte(grey + tint * (c - 1) * std::sin((x + y) / 40.0)));
    }
  return out;
}

std::vector<PixelWindow> windows_of(const Pixels& pixels) {
  std::vector<PixelWindow> out;
  for (std::uint32_t y = 0; y < pixels.height_px; y += 32)
    for (std::uint32_t x = 0; x < pixels.width_px; x += 32)
      out.push_back({pixels.at(x, y), std::size_t{pixels.width_px} * 3, 32, 32, {}});
  return out;
}

CodingSpace space_of(const Pixels& pixels, DataKind kind = DataKind::kNumbers, int threads = 1,
                     bool needs_z = true) {
  RunContext context;
  context.threads = threads;
  return measure_coding_space(kind, needs_z, windows_of(pixels), context);
}

/// Bumps whose vectors have that length, and z of that sign.
Pixels bumps(double length, double sign) {
  Pixels map{kSide, kSide, 3, {}};
  Random random{9};
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x) {
      const double u = waves(x, y, 4, random) / 128, v = waves(y, x, 6, random) / 128;
      const double z = sign * std::sqrt(std::max(0.0, 1 - u * u - v * v));
      for (const double n : {u, v, z}) map.data.push_back(byte(n * 127 * length));
    }
  return map;
}

TEST(CodingSpace, ChannelsThatHaveNothingInCommonStayApart) { EXPECT_EQ(space_of(unrelated()), kApart); }

TEST(CodingSpace, ChannelsThatAreAlikeAreCodedAsYcc) {
  EXPECT_FALSE(space_of(alike(30)).apart);
  EXPECT_FALSE(space_of(alike(0)).apart);
}

TEST(CodingSpace, ChromaIsHalvedOnlyWhereItIsSmooth) {
  EXPECT_EQ(space_of(alike(30)), kYcc420);
  Pixels rough = alike(30);
  for (std::size_t k = 0; k < rough.data.size(); k += 3)  // red of every second texel is darker
    if (k / 3 % 2) rough.data[k] = static_cast<std::uint8_t>(rough.data[k] / 2);
  EXPECT_NE(space_of(rough), kYcc420);
}

TEST(CodingSpace, VectorsGoByTheirAngle) {
  const Pixels map = bumps(1, 1);
  EXPECT_TRUE(space_of(map, DataKind::kVectors).apart);
  EXPECT_TRUE(space_of(map, DataKind::kVectors).coarse_last);  // z follows from x and y
  EXPECT_FALSE(space_of(map).coarse_last);
}

TEST(CodingSpace, ZIsLeftToTheReaderWhereItFollows) {
  const auto leaves_z = [](const Pixels& map, DataKind kind, bool needs_z) {
    return space_of(map, kind, 1, needs_z).without_z;
  };
  EXPECT_TRUE(leaves_z(bumps(1, 1), DataKind::kVectors, false));
  EXPECT_TRUE(leaves_z(bumps(0.8, 1), DataKind::kVectors, false)) << "length turns no vector";
  EXPECT_FALSE(leaves_z(bumps(1, -1), DataKind::kVectors, false)) << "z below 0 does not follow";
  EXPECT_FALSE(leaves_z(bumps(1, 1), DataKind::kVectors, true));
  EXPECT_FALSE(leaves_z(bumps(1, 1), DataKind::kNumbers, false));
}

TEST(CodingSpace, NothingIsKnownOfAnEmptySample) {
  EXPECT_EQ(measure_coding_space(DataKind::kNumbers, true, {}, RunContext{}), kApart);
  EXPECT_EQ(measure_coding_space(DataKind::kVectors, true, {}, RunContext{}), kApart);
}

TEST(CodingSpace, OneColourStaysApart) {
  Pixels flat{kSide, kSide, 3, std::vector<std::uint8_t>(std::size_t{kSide} * kSide * 3, 128)};
  EXPECT_EQ(space_of(flat), kApart);
  EXPECT_EQ(space_of(flat, DataKind::kVectors), kApart);
}

TEST(CodingSpace, OnlyCoveredTexelsCount) {
  // Channels alike where charts lie, unrelated elsewhere.
  Pixels pixels = alike(0);
  const Pixels other = unrelated();
  std::vector<std::uint8_t> coverage(kSide / 8 * kSide);
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x) {
      if (x % 32 < 16) {
        coverage[y * kSide / 8 + x / 8] |= static_cast<std::uint8_t>(128 >> x % 8);
        continue;
      }
      const std::size_t at = (std::size_t{y} * kSide + x) * 3;
      std::copy_n(other.data.begin() + static_cast<std::ptrdiff_t>(at), 3,
                  pixels.data.begin() + static_cast<std::ptrdiff_t>(at));
    }
  std::vector<PixelWindow> windows = windows_of(pixels);
  for (std::size_t k = 0; k < windows.size(); ++k)
    windows[k].coverage = {CoverageMask(coverage, kSide, kSide), static_cast<std::uint32_t>(k % 8 * 32),
                           static_cast<std::uint32_t>(k / 8 * 32)};
  EXPECT_FALSE(measure_coding_space(DataKind::kNumbers, true, windows, RunContext{}).apart);
}

TEST(CodingSpace, SameForAnyNumberOfThreads) {
  for (const Pixels& pixels : {unrelated(), alike(30)})
    EXPECT_EQ(space_of(pixels, DataKind::kVectors, 1), space_of(pixels, DataKind::kVectors, 8));
}

}  // namespace texmesh::coding_space_test
