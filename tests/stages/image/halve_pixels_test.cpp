#include "stages/image/resize.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>

#include "format/base/errors.h"
#include "tests/support/meshes.h"

namespace texmesh::halve_pixels_test {

Pixels noise(std::uint32_t w, std::uint32_t h, std::uint32_t channels, std::uint64_t seed = 3) {
  Pixels out{w, h, channels, {}};
  testing::Random random{seed};
  for (std::size_t k = 0; k < std::size_t{w} * h * channels; ++k)
    out.data.push_back(static_cast<std::uint8_t>(random.next() >> 5));
  return out;
}

double linear(int v) {
  const double x = v / 255.0;
  return x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
}
double encoded(double y) { return 255 * (y <= 0.0031308 ? 12.92 * y : 1.055 * std::pow(y, 1 / 2.4) - 0.055); }

/// The mean over the rectangle of output texel (i, j) of `to`, by areas.
double mean_over(const Pixels& p, std::uint32_t w, std::uint32_t h, std::array<std::uint32_t, 2> to,
                 std::uint32_t i, std::uint32_t j, std::uint32_t c, bool light) {
  const double ow = to[0], oh = to[1];
  const double x0 = i * w / ow, x1 = (i + 1) * w / ow, y0 = j * h / oh, y1 = (j + 1) * h / oh;
  double sum = 0, area = 0;
  for (std::uint32_t y = 0; y < h; ++y)
    for (std::uint32_t x = 0; x < w; ++x) {
      const double a = std::max(0.0, std::min(x1, x + 1.0) - std::max(x0, x + 0.0)) *
                       std::max(0.0, std::min(y1, y + 1.0) - std::max(y0, y + 0.0));
      sum += a * (light ? linear(p.at(x, y)[c]) : p.at(x, y)[c]);
      area += a;
    }
  return sum / area;
}

TEST(HalvePixels, IsTheMeanOverEveryTexelsAreaAtAnySize) {
  for (const auto& [w, h] :
       {std::array{8u, 6u}, {7u, 5u}, {1u, 1u}, {1u, 9u}, {15u, 2u}, {2u, 3u}, {33u, 1u}})
    for (const std::uint32_t channels : {1u, 3u}) {
      const Pixels padded = noise(w + 5, h + 3, channels);  // what lies beyond must not matter
      const Pixels numbers = halved(padded, w, h, Averaging::kNumbers);
      const Pixels light = halved(padded, w, h, Averaging::kLight);
      ASSERT_EQ(numbers.width_px, (w + 1) / 2);
      ASSERT_EQ(numbers.height_px, (h + 1) / 2);
      for (std::uint32_t y = 0; y < numbers.height_px; ++y)
        for (std::uint32_t x = 0; x < numbers.width_px; ++x)
          for (std::uint32_t c = 0; c < channels; ++c) {
            EXPECT_NEAR(numbers.at(x, y)[c],
                        mean_over(padded, w, h, {(w + 1) / 2, (h + 1) / 2}, x, y, c, false), 0.5001);
            // The 16-bit table is coarser than a code only below 5 (slope 12.92).
            EXPECT_NEAR(light.at(x, y)[c],
                        encoded(mean_over(padded, w, h, {(w + 1) / 2, (h + 1) / 2}, x, y, c, true)), 0.53);
          }
    }
}

TEST(HalvePixels, AnEighthIsTheMeanOverEveryTexelsAreaAtAnySize) {
  for (const auto& [w, h] : {std::array{16u, 24u}, {17u, 1u}, {1u, 9u}, {15u, 65u}, {25u, 31u}, {7u, 8u}}) {
    const Pixels padded = noise(w + 5, h + 3, 3);
    RunContext eight;
    eight.threads = 8;
    for (const Averaging kind : {Averaging::kNumbers, Averaging::kLight}) {
      const Pixels small = eighth_of(padded, w, h, kind, {});
      EXPECT_EQ(small.data, eighth_of(padded, w, h, kind, eight).data);
      ASSERT_EQ(small.width_px, (w + 7) / 8);
      ASSERT_EQ(small.height_px, (h + 7) / 8);
      for (std::uint32_t y = 0; y < small.height_px; ++y)
        for (std::uint32_t x = 0; x < small.width_px; ++x)
          for (std::uint32_t c = 0; c < 3; ++c) {
            const bool light = kind == Averaging::kLight;
            const double mean = mean_over(padded, w, h, {small.width_px, small.height_px}, x, y, c, light);
            EXPECT_NEAR(small.at(x, y)[c], light ? encoded(mean) : mean, 0.53);
          }
    }
  }
  EXPECT_EQ(eighth_of(noise(64, 64, 3), 64, 64, Averaging::kNormals, {}).data.size(), 8u * 8u * 3u);
}

TEST(HalvePixels, ConstantsStayAndLightIsBrighterThanNumbers) {
  for (int v = 0; v < 256; ++v) {
    const Pixels flat{5, 4, 1, std::vector<std::uint8_t>(20, static_cast<std::uint8_t>(v))};
    EXPECT_EQ(halved(flat, 5, 4, Averaging::kLight).data, std::vector<std::uint8_t>(6, flat.data[0]));
    EXPECT_EQ(halved(flat, 5, 4, Averaging::kNumbers).data, std::vector<std::uint8_t>(6, flat.data[0]));
  }
  const Pixels board{2, 2, 1, {0, 255, 255, 0}};
  EXPECT_EQ(halved(board, 2, 2, Averaging::kLight).data[0], 188);  // half the light
  EXPECT_EQ(halved(board, 2, 2, Averaging::kNumbers).data[0], 128);
}

TEST(HalvePixels, NormalsHaveUnitLengthAgain) {
  Pixels normals{64, 32, 3, {}};
  testing::Random random{5};
  for (int k = 0; k < 64 * 32; ++k) {
    const double x = static_cast<double>(random.next() % 100) / 120 - 0.4,
                 y = static_cast<double>(random.next() % 100) / 120 - 0.4;
    for (const double v : {x, y, std::sqrt(1 - x * x - y * y)})
      normals.data.push_back(static_cast<std::uint8_t>(std::lround((v + 1) * 127.5)));
  }
  const Pixels half = halved(normals, 64, 32, Averaging::kNormals);
  for (std::uint32_t y = 0; y < 16; ++y)
    for (std::uint32_t x = 0; x < 32; ++x) {
      double squared = 0;
      for (int c = 0; c < 3; ++c) squared += std::pow(half.at(x, y)[c] / 127.5 - 1, 2);
      EXPECT_NEAR(std::sqrt(squared), 1, 0.01);
    }
  // Opposite vectors have no direction: their mean stays.
  const Pixels against{2, 1, 3, {255, 128, 128, 0, 128, 128}};
  EXPECT_NEAR(halved(against, 2, 1, Averaging::kNormals).data[0], 128, 1);
}

TEST(HalvePixels, WhatIsNotThereIsRefused) {
  const Pixels p = noise(8, 8, 3);
  EXPECT_THROW(halved(p, 9, 8, Averaging::kLight), StageError);
  EXPECT_THROW(halved(p, 8, 0, Averaging::kLight), StageError);
  EXPECT_THROW(halved(noise(8, 8, 1), 8, 8, Averaging::kNormals), StageError);
  EXPECT_THROW(halved(noise(8, 8, 4), 8, 8, Averaging::kNumbers), StageError);
  Pixels shorter = p;
  shorter.data.pop_back();
  EXPECT_THROW(halved(shorter, 8, 8, Averaging::kLight), StageError);
}

TEST(HalvePixels, AlphaCountsApartAndAsNumbers) {
  const Pixels from = noise(9, 6, 4), out = reduced_with_alpha(from, 5, 3, Averaging::kLight);
  Pixels colours{9, 6, 3, {}}, alpha{9, 6, 1, {}};
  for (std::size_t i = 0; i < from.data.size(); ++i)
    (i % 4 < 3 ? colours : alpha).data.push_back(from.data[i]);
  EXPECT_EQ(out.channels, 4u);
  EXPECT_EQ(out.data, joined_alpha(reduced(colours, 9, 6, 5, 3, Averaging::kLight),
                                   reduced(alpha, 9, 6, 5, 3, Averaging::kNumbers))
                          .data);
  const Pixels grey = reduced_with_alpha({1, 1, 2, {7, 9}}, 1, 1, Averaging::kLight);
  EXPECT_EQ(grey.data, (std::vector<std::uint8_t>{7, 7, 7, 9}));
}

}  // namespace texmesh::halve_pixels_test
