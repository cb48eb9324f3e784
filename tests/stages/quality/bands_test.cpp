#include "stages/quality/shots.h"

#include <gtest/gtest.h>

#include <algorithm>

#include "stages/measure/flip.h"
#include "stages/render/visibility.h"

namespace texmesh::bands_test {

ShownRows rows_of(double first, double end) {
  ShownRows out{first, end, std::vector<std::uint32_t>(100)};
  for (std::size_t i = 0; i < 100; ++i) {
    const double row = (static_cast<double>(i) + 0.5) / 100;
    out.pixels[i] = row > first && row < end ? 50 : 0;
  }
  return out;
}
const ShownRows kAllRows = rows_of(0, 1);

TEST(Bands, WhereLittleIsShownPicturesAreWhole) {
  EXPECT_TRUE(choose_bands(kAllRows, 1024, 20000).rendered.empty());
  EXPECT_TRUE(choose_bands(kAllRows, 128, 1e9).rendered.empty());
  EXPECT_TRUE(choose_bands(rows_of(0.45, 0.55), 1024, 1e9).rendered.empty());  // too flat for two bands
  EXPECT_TRUE(choose_bands({}, 1, 0).compared.empty());
}

TEST(Bands, TheyAreEvenlySpreadAndOneLiesInTheMiddle) {
  for (const ShownRows& rows : {kAllRows, rows_of(0.1, 0.9), rows_of(0.5, 1)}) {
    const Bands bands = choose_bands(rows, 1024, 100000);
    ASSERT_EQ(bands.rendered.size(), 32u);
    ASSERT_EQ(bands.compared.size(), 1024u);
    const auto middle = static_cast<std::size_t>((rows.first + rows.end) / 2 * 1024);
    EXPECT_TRUE(bands.compared[middle]) << rows.first;
    std::vector<std::size_t> begins;  // of bands that are whole
    for (std::size_t t = 1; t + 2 < bands.rendered.size(); ++t)
      if (!bands.rendered[t - 1] && bands.rendered[t]) begins.push_back(t);
    ASSERT_GE(begins.size(), 2u) << rows.first;
    for (std::size_t i = 1; i < begins.size(); ++i)
      EXPECT_EQ(begins[i] - begins[i - 1], begins[1] - begins[0]) << rows.first;
    for (std::size_t begin : begins)
      for (std::size_t t = begin; t < begin + 4; ++t) EXPECT_EQ(bands.rendered[t], t < begin + 3) << t;
    EXPECT_LE(std::ranges::count(bands.rendered, 1), 18);
    EXPECT_GE(std::ranges::count(bands.rendered, 1), 9);
  }
}

TEST(Bands, AnObjectBetweenTheBandsIsComparedWhole) {
  ShownRows ends = kAllRows;  // a dumb-bell: next to nothing in the middle
  const Bands usual = choose_bands(ends, 1024, 100000);
  ASSERT_FALSE(usual.compared.empty());
  for (std::size_t i = 0; i < 100; ++i)
    if (usual.compared[(2 * i + 1) * 1024 / 200]) ends.pixels[i] = 1;
  EXPECT_TRUE(choose_bands(ends, 1024, 100000).compared.empty());
}

TEST(Bands, WhatIsComparedIsRenderedAsFarAsFiltersSee) {
  const Bands bands = choose_bands(kAllRows, 1000, 150000);
  for (int y = 0; y < 1000; ++y)
    for (int d = -10; bands.compared[static_cast<std::size_t>(y)] && d <= 10; ++d)
      EXPECT_TRUE(bands.rendered[static_cast<std::size_t>(std::clamp(y + d, 0, 999)) / kBandPx]);
  EXPECT_TRUE(std::ranges::find(bands.compared, 1) != bands.compared.end());
}

/// Squares whose colours tell where they are.
Picture picture_of(std::uint32_t side, float brightness) {
  Picture out{side, std::vector<Vec3f>(std::size_t{side} * side, {0.2f, 0.2f, 0.2f}),
              std::vector<std::uint8_t>(std::size_t{side} * side)};
  for (std::uint32_t y = 20; y + 20 < side; ++y)
    for (std::uint32_t x = 20; x + 20 < side; ++x) {
      const std::size_t i = std::size_t{y} * side + x;
      out.covered[i] = 1;
      out.linear[i] = {brightness * static_cast<float>(y / 5 % 7) / 7, static_cast<float>(x / 3 % 5) / 5,
                       0.3f};
    }
  return out;
}

TEST(Bands, ComparedPixelsHaveTheValuesOfTheWholePicture) {
  constexpr std::uint32_t kSide = 640;
  const Picture a = picture_of(kSide, 1), b = picture_of(kSide, 0.8f);
  const std::vector<float> whole = flip_map(prepare_flip(a), prepare_flip(b));
  const Bands bands = choose_bands(kAllRows, kSide, 1e6);
  ASSERT_FALSE(bands.rendered.empty());
  const auto banded = [&](Picture picture) {
    for (std::size_t i = 0; i < picture.linear.size(); ++i)
      if (!bands.rendered[i / kSide / kBandPx])
        picture.linear[i] = {0.2f, 0.2f, 0.2f}, picture.covered[i] = 0;
    bands.cut(picture);
    return picture;
  };
  const Picture some_a = banded(a), some_b = banded(b);
  const std::vector<float> part = flip_map(prepare_flip(some_a), prepare_flip(some_b));
  for (std::size_t i = 0; i < whole.size(); ++i)
    EXPECT_EQ(part[i], bands.compared[i / kSide] ? whole[i] : 0) << i;
}

}  // namespace texmesh::bands_test
