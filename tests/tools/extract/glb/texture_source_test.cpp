// Smaller copies of what a mesh shows.
#include "tools/extract/glb/texture_source.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>

#include "stages/data/fragments.h"
#include "tests/support/packages.h"

namespace texmesh::texture_source_test {

const std::string kGolden = std::string(TEXMESH_SOURCE_DIR) + "/tests/golden/v2.0-scan.texmesh";
constexpr std::uint32_t kTimes = 8;

/// Columns up to the middle of a block of 8.
std::vector<std::uint8_t> left_half(std::uint32_t width_px, std::uint32_t height_px) {
  std::vector<std::uint8_t> bits(coverage_size_bytes(width_px, height_px));
  for (std::uint32_t y = 0; y < height_px; ++y)
    for (std::uint32_t x = 0; x < width_px / 2 + kTimes / 2; ++x) {
      std::uint8_t& byte = bits[y * coverage_stride_bytes(width_px) + x / 8];
      byte = static_cast<std::uint8_t>(byte | 1u << (7 - x % 8));
    }
  return bits;
}

TEST(TextureSource, WhatIsFarFromAllThatIsShownIsNotRead) {
  PackageReader package(open_store(kGolden));
  TextureSource plain(package, 1e9, {}), shown(package, 1e9, {});
  const PackageImage& image = plain.images().at(0);
  const std::uint32_t w = image.width_px, h = image.height_px, middle = w / 2 / kTimes;
  shown.set_shown(0, left_half(w, h));
  const Pixels a = plain.texels(0, w / kTimes, h / kTimes, {}, 0),
               b = shown.texels(0, w / kTimes, h / kTimes, {}, 0);
  std::size_t other = 0;
  for (std::uint32_t y = 0; y < b.height_px; ++y)
    for (std::uint32_t x = 0; x < b.width_px; ++x) {
      const bool equal = std::equal(b.at(x, y), b.at(x, y) + b.channels, a.at(x, y));
      if (x <= middle) ASSERT_TRUE(equal) << x << ", " << y;
      other += !equal;
    }
  EXPECT_GT(other, std::size_t{b.height_px} * (b.width_px - middle - 1) / 2);
}

TEST(TextureSource, OfAnImageThatNoMaterialHasAllIsShown) {
  constexpr std::uint32_t kWidth = 20, kHeight = 9;
  const std::vector<std::uint8_t> bits = shown_texels({}, {}, 3, kWidth, kHeight);
  std::size_t shown = 0;
  for (const std::uint8_t byte : bits) shown += static_cast<std::size_t>(std::popcount(byte));
  EXPECT_EQ(shown, std::size_t{kWidth} * kHeight);
}

}  // namespace texmesh::texture_source_test
