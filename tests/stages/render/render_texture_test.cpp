#include "stages/render/render_texture.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

#include "format/base/portable_math.h"
#include "stages/render/render_math.h"
#include "tests/stages/render/render_fixtures.h"

namespace texmesh::render_texture_test {

using testing::texture_of;

Vec4f read_texture(const RenderTexture& texture, const TextureSlot& slot, const TextureFootprint& footprint) {
  return TextureSite({texture.width_px, texture.height_px}, texture.first_level, slot, footprint)
      .read(texture);
}

TextureFootprint point(float u, float v) { return {{u, v}, {}, {}}; }

// 4 x 1 texels of 0, 60, 120, 180.
RenderTexture steps(std::uint32_t channels = 1) {
  return texture_of(4, 1, channels, false,
                    [](auto x, auto, auto) { return static_cast<std::uint8_t>(60 * x); });
}
float step_at(float u, Wrap wrap) {
  TextureSlot slot;
  slot.wrap_s = wrap;
  return read_texture(steps(), slot, point(u, 0.5f)).x * 255;
}

TEST(RenderTexture, MathAgreesWithTheStandardLibrary) {
  for (float x = 1e-30f; x < 1e30f; x *= 1.37f) EXPECT_NEAR(log2_of(x), std::log2(x), 2e-5);
  for (float x = 0.5f; x < 2; x += 0.01f) EXPECT_NEAR(log2_of(x), std::log2(x), 1e-6);
  for (float x = -126; x < 126; x += 0.173f) EXPECT_NEAR(exp2_of(x) / std::exp2(x), 1, 3e-7);
  EXPECT_EQ(exp2_of(std::numeric_limits<float>::quiet_NaN()), exp2_of(-126.f));
  for (float x = 1e-30f; x < 130; x *= 1.07f) {
    const Lanes lanes{x, 2 * x, -x, x / 3}, raised = exp2_of(lanes), positive{x, 2 * x, x / 7, x / 3};
    for (std::size_t i = 0; i < kLanes; ++i) {
      EXPECT_EQ(raised[i], exp2_of(lanes[i]));
      EXPECT_EQ(log2_of(positive)[i], log2_of(positive[i]));
    }
  }
}

TEST(RenderTexture, MipsOfNumbersAreRoundedMeans) {
  for (const std::uint32_t channels : {1u, 2u, 3u, 4u}) {
    std::uint32_t seed = 7;
    const RenderTexture t = texture_of(32, 16, channels, false, [&](auto, auto, auto) {
      return static_cast<std::uint8_t>((seed = seed * 1664525 + 1013904223) >> 24);
    });
    const Pixels &fine = t.levels[0], &coarse = t.levels[1];
    for (std::uint32_t y = 0; y < 8; ++y)
      for (std::uint32_t x = 0; x < 16; ++x)
        for (std::uint32_t c = 0; c < channels; ++c) {
          const int sum = fine.at(2 * x, 2 * y)[c] + fine.at(2 * x + 1, 2 * y)[c] +
                          fine.at(2 * x, 2 * y + 1)[c] + fine.at(2 * x + 1, 2 * y + 1)[c];
          EXPECT_EQ(coarse.at(x, y)[c], static_cast<int>(sum / 4.0 + 0.5));
        }
  }
}

TEST(RenderTexture, TexelsAreReadAtTheirMiddlesAndLinearlyBetween) {
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror}) {
    EXPECT_NEAR(step_at(0.125f, wrap), 0, 1e-3);
    EXPECT_NEAR(step_at(0.375f, wrap), 60, 1e-3);
    EXPECT_NEAR(step_at(0.5f, wrap), 90, 1e-3);
    EXPECT_NEAR(step_at(0.875f, wrap), 180, 1e-3);
  }
}

TEST(RenderTexture, WrapModesFoldTheCoordinates) {
  EXPECT_NEAR(step_at(0, Wrap::kRepeat), 90, 1e-3);  // between the last texel and the first
  EXPECT_NEAR(step_at(0, Wrap::kClamp), 0, 1e-3);
  EXPECT_NEAR(step_at(0, Wrap::kMirror), 0, 1e-3);
  EXPECT_NEAR(step_at(1.375f, Wrap::kRepeat), 60, 1e-2);
  EXPECT_NEAR(step_at(1.375f, Wrap::kClamp), 180, 1e-3);
  EXPECT_NEAR(step_at(1.375f, Wrap::kMirror), 120, 1e-2);
  EXPECT_NEAR(step_at(-0.375f, Wrap::kRepeat), 120, 1e-2);
  EXPECT_NEAR(step_at(-0.375f, Wrap::kMirror), 60, 1e-2);
  EXPECT_NEAR(step_at(2.375f, Wrap::kMirror), 60, 1e-2);
}

TEST(RenderTexture, CoordinatesThatAreNotFiniteReadACorner) {
  const float kInfinity = std::numeric_limits<float>::infinity(), kNan = std::nanf("");
  for (const Wrap wrap : {Wrap::kRepeat, Wrap::kClamp, Wrap::kMirror})
    for (const float u : {kInfinity, -kInfinity, kNan, 3e38f}) {
      const float value = step_at(u, wrap);
      EXPECT_GE(value, 0);
      EXPECT_LE(value, 180);
    }
  TextureFootprint edge_on = point(0.3f, 0.5f);
  edge_on.uv_dx = {kNan, kInfinity};
  const RenderTexture texture = steps();
  EXPECT_NEAR(read_texture(texture, {}, edge_on).x * 255, texture.levels.back().data[0], 1e-3);
}

TEST(RenderTexture, ChannelsBecomeThoseThatAShaderReads) {
  auto value = [](std::uint32_t, std::uint32_t, std::uint32_t c) {
    return static_cast<std::uint8_t>(50 * (c + 1));
  };
  const Vec4f expected[] = {{50, 50, 50, 255}, {50, 50, 50, 100}, {50, 100, 150, 255}, {50, 100, 150, 200}};
  for (std::uint32_t n = 1; n <= 4; ++n) {
    const Vec4f read = read_texture(texture_of(2, 2, n, false, value), {}, point(0.4f, 0.7f));
    EXPECT_NEAR(read.x * 255, expected[n - 1].x, 1e-3);
    EXPECT_NEAR(read.y * 255, expected[n - 1].y, 1e-3);
    EXPECT_NEAR(read.z * 255, expected[n - 1].z, 1e-3);
    EXPECT_NEAR(read.w * 255, expected[n - 1].w, 1e-3);
    const Vec4f light = read_texture(texture_of(2, 2, n, true, value), {}, point(0.4f, 0.7f));
    EXPECT_NEAR(light.x, light_of_srgb(50 / 255.), 1e-6);
    EXPECT_NEAR(light.w * 255, expected[n - 1].w, 1e-3) << "alpha is never sRGB";
  }
}

TEST(RenderTexture, LevelsHaveOpenGlsSidesAndKeepTheMean) {
  const RenderTexture texture = texture_of(
      37, 6, 3, false, [](auto x, auto y, auto c) { return static_cast<std::uint8_t>(3 * x + y + c); });
  ASSERT_EQ(texture.levels.size(), 6u);
  for (std::size_t l = 0; l < texture.levels.size(); ++l) {
    EXPECT_EQ(texture.levels[l].width_px, std::max(37u >> l, 1u));
    EXPECT_EQ(texture.levels[l].height_px, std::max(6u >> l, 1u));
  }
  EXPECT_NEAR(texture.levels.back().data[0], 3 * 18 + 2.5, 4);
}

TEST(RenderTexture, ColoursAreAveragedInLinearLightAndNumbersAsTheyAre) {
  auto board = [](std::uint32_t x, std::uint32_t y, std::uint32_t) {
    return static_cast<std::uint8_t>((x + y) % 2 == 0 ? 0 : 255);
  };
  const RenderTexture light = texture_of(8, 8, 4, true, board), numbers = texture_of(8, 8, 4, false, board);
  for (std::size_t l = 1; l < 4; ++l) {
    EXPECT_EQ(light.levels[l].data[0], 188);  // half the light
    EXPECT_EQ(light.levels[l].data[3], 128);
    EXPECT_EQ(numbers.levels[l].data[0], 128);
  }
}

TEST(RenderTexture, AnEvenTextureStaysTheSameAtEveryLevel) {
  for (int code = 0; code < 256; ++code) {
    const RenderTexture texture =
        texture_of(13, 9, 1, true, [code](auto, auto, auto) { return static_cast<std::uint8_t>(code); });
    for (const Pixels& level : texture.levels)
      for (const std::uint8_t value : level.data) ASSERT_EQ(value, code);
  }
}

TEST(RenderTexture, TheLongerDerivativeChoosesTheLevel) {
  // Level l holds the value 40 l everywhere.
  RenderTexture texture = texture_of(16, 16, 1, false, [](auto, auto, auto) { return std::uint8_t{0}; });
  for (std::size_t l = 0; l < texture.levels.size(); ++l)
    for (std::uint8_t& v : texture.levels[l].data) v = static_cast<std::uint8_t>(40 * l);
  auto level_at = [&](Vec2f dx, Vec2f dy, const TextureSlot& slot) {
    return read_texture(texture, slot, {{0.3f, 0.6f}, dx, dy}).x * 255 / 40;
  };
  const TextureSlot trilinear;
  EXPECT_NEAR(level_at({1 / 16.f, 0}, {0, 0}, trilinear), 0, 1e-3);
  EXPECT_NEAR(level_at({2 / 16.f, 0}, {0, 1 / 16.f}, trilinear), 1, 1e-3);
  EXPECT_NEAR(level_at({0, 1 / 16.f}, {3 / 16.f, 4 / 16.f}, trilinear), std::log2(5.), 1e-3);
  EXPECT_NEAR(level_at({9, 9}, {0, 0}, trilinear), 4, 1e-3);
  TextureSlot flat;
  flat.min_filter = MinFilter::kLinear;
  EXPECT_NEAR(level_at({9, 9}, {0, 0}, flat), 0, 1e-3);
  flat.min_filter = MinFilter::kNearest;
  EXPECT_NEAR(level_at({9, 9}, {0, 0}, flat), 0, 1e-3);
}

TEST(RenderTexture, NearestReadsOneTexel) {
  TextureSlot slot;
  slot.mag_filter = MagFilter::kNearest;
  for (const float u : {0.251f, 0.4f, 0.499f})
    EXPECT_NEAR(read_texture(steps(), slot, point(u, 0.5f)).x * 255, 60, 1e-3);
  EXPECT_NEAR(read_texture(steps(), slot, point(1, 0.5f)).x * 255, 0, 1e-3) << "repeats";
}

TEST(RenderTexture, FinerLevelsThatAreNotKeptAreReplacedByTheFirstThatIs) {
  Pixels image{16, 8, 3, {}};
  for (std::uint32_t i = 0; i < 16 * 8 * 3; ++i) image.data.push_back(static_cast<std::uint8_t>(i * 37));
  const RenderTexture whole = render_texture(image, true, 0, {}), part = render_texture(image, true, 2, {});
  EXPECT_EQ(part.first_level, 2u);
  EXPECT_EQ(part.width_px, 16u);
  ASSERT_EQ(part.levels.size() + 2, whole.levels.size());
  for (std::size_t l = 0; l < part.levels.size(); ++l)
    EXPECT_EQ(part.levels[l].data, whole.levels[l + 2].data);
  // Beyond level 2 both are the same texture.
  const TextureFootprint wide{{0.3f, 0.6f}, {5 / 16.f, 0}, {0, 0}};
  EXPECT_EQ(read_texture(part, {}, wide), read_texture(whole, {}, wide));
  const Vec4f sharp = read_texture(part, {}, point(0.3f, 0.6f));
  EXPECT_EQ(sharp, read_texture(part, {}, {{0.3f, 0.6f}, {4 / 16.f, 0}, {0, 0}}));
  EXPECT_EQ(render_texture(image, true, 99, {}).levels.size(), 1u);
}

TEST(RenderTexture, PlacesOfTwoLevelsAtOnceAreThoseOfEachAlone) {
  std::uint32_t seed = 5;
  const auto next = [&seed] { return (seed = seed * 1664525 + 1013904223) >> 8; };
  for (const std::uint32_t width : {1u, 2u, 5u, 64u, 97u}) {
    const RenderTexture whole =
        texture_of(width, 33, 3, false, [&](auto, auto, auto) { return static_cast<std::uint8_t>(next()); });
    RenderTexture coarse = whole;
    coarse.levels.erase(coarse.levels.begin(), coarse.levels.begin() + 3);
    coarse.first_level = 3;
    for (int i = 0; i < 300; ++i) {
      TextureSlot slot;
      slot.wrap_s = static_cast<Wrap>(i % 3), slot.wrap_t = static_cast<Wrap>(i / 3 % 3);
      const auto place = [&] { return static_cast<float>(next() % 65536) / 16384 - 2; };
      const TextureFootprint here = point(place(), place());
      // Of level 3 the first site knows no places, the other has found them together with those of level 4.
      const TextureSite alone({width, 33}, 0, slot, here), together({width, 33}, 3, slot, here);
      EXPECT_EQ(alone.read(coarse), together.read(coarse)) << width << ' ' << i;
    }
  }
}

TEST(RenderTexture, OneTexelIsATexture) {
  const RenderTexture texture =
      texture_of(1, 1, 3, false, [](auto, auto, auto c) { return static_cast<std::uint8_t>(c); });
  for (const float u : {-3.f, 0.f, 0.5f, 1.f, 7.3f})
    EXPECT_NEAR(read_texture(texture, {}, {{u, u}, {9, 0}, {0, 9}}).z * 255, 2, 1e-4);
}

TEST(RenderTexture, TransformIsThatOfTheExtension) {
  const UvTransform transform{{0.1f, 0.2f}, {2, 3}, 0.5f};
  const UvMatrix matrix = uv_matrix(transform);
  const double c = std::cos(0.5), s = std::sin(0.5), u = 0.3, v = 0.7;
  const Vec2f placed = matrix.place({0.3f, 0.7f});
  EXPECT_NEAR(placed.x, 0.1 + c * 2 * u + s * 3 * v, 1e-6);
  EXPECT_NEAR(placed.y, 0.2 - s * 2 * u + c * 3 * v, 1e-6);
  EXPECT_EQ(uv_matrix({}).place({0.3f, 0.7f}), (Vec2f{0.3f, 0.7f}));
}

TEST(RenderTexture, SameBytesForAnyNumberOfThreads) {
  testing::Random random{3};
  Pixels image{301, 203, 3, {}};
  image.data.resize(std::size_t{301} * 203 * 3);
  for (std::uint8_t& v : image.data) v = static_cast<std::uint8_t>(random.next());
  const RenderTexture one = render_texture(image, true, 0, {}),
                      many = render_texture(image, true, 0, {8, {}, nullptr});
  for (std::size_t l = 0; l < one.levels.size(); ++l) EXPECT_EQ(one.levels[l].data, many.levels[l].data);
}

TEST(RenderTexture, WhatIsNoImageIsRefused) {
  EXPECT_THROW(render_texture({}, true, 0, {}), std::invalid_argument);
  EXPECT_THROW(render_texture({1, 1, 5, {1, 2, 3, 4, 5}}, true, 0, {}), std::invalid_argument);
  EXPECT_THROW(render_texture({2, 2, 1, {1, 2, 3}}, true, 0, {}), std::invalid_argument);
}

TEST(RenderTexture, APartOfAMipIsTheMipOfThePart) {
  Pixels whole{32, 16, 3, {}};
  for (std::uint32_t i = 0; i < 32 * 16 * 3; ++i)
    whole.data.push_back(static_cast<std::uint8_t>(i * i % 253));
  Pixels right{16, 16, 3, {}};
  for (std::uint32_t y = 0; y < 16; ++y)
    right.data.insert(right.data.end(), whole.at(16, y), whole.at(16, y) + 48);
  for (const bool srgb : {false, true}) {
    const Pixels mip = coarser_level(whole, srgb, 2, {}), part = coarser_level(right, srgb, 2, {});
    ASSERT_EQ(mip.width_px, 8u);
    ASSERT_EQ(part.width_px, 4u);
    for (std::uint32_t y = 0; y < 4; ++y)
      EXPECT_TRUE(std::equal(part.at(0, y), part.at(0, y) + 12, mip.at(4, y)));
    EXPECT_EQ(mip.data, render_texture(whole, srgb, 2, {}).levels[0].data);
  }
  EXPECT_EQ(coarser_level(right, false, 9, {}).width_px, 1u);
}

}  // namespace texmesh::render_texture_test
