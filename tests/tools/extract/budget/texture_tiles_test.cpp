// Parts of a texture that tell what its whole file shows and how large it is.
#include "tools/extract/budget/texture_tiles.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/geometry/texel_coverage.h"

namespace texmesh::texture_tiles_test {

Pixels picture(std::uint32_t width_px, std::uint32_t height_px) {
  Pixels out{width_px, height_px, 3, {}};
  for (std::uint32_t y = 0; y < height_px; ++y)
    for (std::uint32_t x = 0; x < width_px; ++x)
      for (std::uint32_t k = 0; k < 3; ++k)
        out.data.push_back(static_cast<std::uint8_t>(128 + 60 * std::sin(0.11 * x + k) * std::cos(0.07 * y) +
                                                     (x * 7919 + y * 104729 + k) % 23));
  return out;
}

std::vector<std::uint8_t> all_covered(const Pixels& image) {
  return std::vector<std::uint8_t>(coverage_size_bytes(image.width_px, image.height_px), 0xff);
}

Pixels decoded(const std::vector<std::uint8_t>& jpeg) { return decode_file_image({FileImage::kJpeg, jpeg}); }

TEST(TextureTiles, StripsAndSmallImagesAreCodedWhole) {
  EXPECT_TRUE(TextureTiles::suits(1024, 512));
  EXPECT_FALSE(TextureTiles::suits(1 << 20, 1));
  EXPECT_FALSE(TextureTiles::suits(1, 1 << 20));
  EXPECT_FALSE(TextureTiles::suits(1 << 16, 16)) << "narrower than a square of the sample";
  EXPECT_FALSE(TextureTiles::suits(1000, 1000)) << "no whole squares";
  EXPECT_FALSE(TextureTiles::suits(256, 256));
}

TEST(TextureTiles, WhatIsReadIsWhatTheWholeFileShows) {
  const Pixels image = picture(1024, 768);
  const std::vector<Vec2f> places{{0.5f, 0.25f}, {0.001f, 0.999f}};
  TextureTiles tiles(image, all_covered(image), places, 2, {});
  const ImageCoding coding{FileImage::kJpeg, 40, false, true, true};
  for (const std::uint32_t first : {0u, 1u}) {
    tiles.prepare(true, first, {});
    const RenderTexture whole = render_texture(decoded(encode_image(image, coding)), true, first, {}),
                        part =
                            tiles.texture_with(decoded(encode_image(tiles.read_tiles(), coding)), true, {}),
                        source = render_texture(image, true, first, {});
    ASSERT_EQ(part.levels.size(), whole.levels.size());
    for (std::uint32_t l = 0; l <= 4 - first; ++l)
      for (const Vec2f place : places) {
        const auto x = static_cast<std::uint32_t>(place.x * static_cast<float>(whole.levels[l].width_px)),
                   y = static_cast<std::uint32_t>(place.y * static_cast<float>(whole.levels[l].height_px));
        for (int k = 0; k < 3; ++k)
          EXPECT_EQ(part.levels[l].at(x, y)[k], whole.levels[l].at(x, y)[k]) << first << " " << l;
      }
    EXPECT_EQ(part.levels.back().data, source.levels.back().data);
    EXPECT_NE(part.levels[0].data, source.levels[0].data);
  }
}

TEST(TextureTiles, TheSampleTellsTheBytesOfTheFile) {
  const Pixels image = picture(2048, 1536);
  const TextureTiles tiles(image, all_covered(image), {}, 2, {});
  EXPECT_LT(tiles.sample().data.size(), image.data.size() / 8);
  EXPECT_EQ(tiles.read_tiles().width_px, TextureTiles::kTilePx);
  for (const double quality : {20.0, 85.0}) {
    const ImageCoding coding{FileImage::kJpeg, quality, false, true, true};
    const auto whole = static_cast<double>(encode_image(image, coding).size());
    EXPECT_NEAR(tiles.file_bytes(encode_image(tiles.sample(), coding).size()), whole, 0.1 * whole);
  }
}

}  // namespace texmesh::texture_tiles_test
