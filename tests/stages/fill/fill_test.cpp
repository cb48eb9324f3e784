#include "stages/fill/fill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdlib>

#include "stages/image/decode_image.h"
#include "stages/image/png_writer.h"
#include "stages/image/resize.h"
#include "stages/jpeg/jpeg.h"
#include "tests/support/coverage_bits.h"
#include "tests/support/meshes.h"

namespace texmesh::fill_test {

using testing::coverage_where;
using testing::Random;

Pixels noise(std::uint32_t w, std::uint32_t h, std::uint32_t channels) {
  Pixels out{w, h, channels, {}};
  Random random{2};
  for (std::size_t k = 0; k < std::size_t{w} * h * channels; ++k)
    out.data.push_back(static_cast<std::uint8_t>(random.next()));
  return out;
}

TEST(Fill, CoveredTexelsStayAndTheOthersLieBetweenThem) {
  for (const std::uint32_t channels : {1u, 3u})
    for (const auto& [w, h] : {std::array{64u, 64u}, {37u, 53u}, {1u, 9u}, {8u, 1u}}) {
      Pixels pixels = noise(w, h, channels);
      for (auto& v : pixels.data) v = static_cast<std::uint8_t>(60 + v % 50);
      const auto covered = [](std::uint32_t x, std::uint32_t y) { return (x / 3 + y / 4) % 4 == 0; };
      const auto coverage = coverage_where(w, h, covered);
      Pixels wild = pixels;  // what is not covered must not matter
      for (std::uint32_t y = 0; y < h; ++y)
        for (std::uint32_t x = 0; x < w; ++x)
          if (!covered(x, y))
            std::fill_n(wild.data.begin() + (y * w + x) * channels, channels, std::uint8_t{255});
      Pixels filled = pixels;
      fill_uncovered(filled, coverage, {});
      fill_uncovered(wild, coverage, {});
      EXPECT_TRUE(filled.data == wild.data);
      for (std::uint32_t y = 0; y < h; ++y)
        for (std::uint32_t x = 0; x < w; ++x)
          for (std::uint32_t c = 0; c < channels; ++c) {
            if (covered(x, y))
              EXPECT_EQ(filled.at(x, y)[c], pixels.at(x, y)[c]);
            else
              EXPECT_TRUE(filled.at(x, y)[c] >= 60 && filled.at(x, y)[c] < 110);
          }
    }
}

TEST(Fill, IsSmoothAndConstantForAConstant) {
  const std::uint32_t w = 100, h = 80;
  Pixels flat{w, h, 3, std::vector<std::uint8_t>(w * h * 3, 77)};
  const auto coverage =
      coverage_where(w, h, [](std::uint32_t x, std::uint32_t y) { return x > 70 && y % 2; });
  for (std::uint32_t k = 0; k < 70; ++k) flat.data[k * 3] = 0;
  fill_uncovered(flat, coverage, {});
  EXPECT_EQ(std::count(flat.data.begin(), flat.data.end(), 77), w * h * 3);

  // Dark on the left, light on the right: what lies between rises without a jump.
  Pixels ramp{128, 8, 1, std::vector<std::uint8_t>(128 * 8)};
  for (std::uint32_t y = 0; y < 8; ++y) std::fill_n(ramp.data.begin() + y * 128 + 112, 16, std::uint8_t{240});
  fill_uncovered(
      ramp, coverage_where(128, 8, [](std::uint32_t x, std::uint32_t) { return x < 16 || x >= 112; }), {});
  for (std::uint32_t x = 1; x < 128; ++x)
    EXPECT_LT(std::abs(ramp.at(x, 4)[0] - ramp.at(x - 1, 4)[0]), 80) << x;
}

TEST(Fill, BlocksThatNobodySeesAreFlatAndBorderBlocksHaveFewCoefficients) {
  // A photograph-like chart covers the left 40 of 96 columns, all rows of 48.
  testing::Random random{31};
  for (const std::uint32_t channels : {1u, 3u}) {
    Pixels pixels{96, 48, channels, {}};
    std::vector<std::uint8_t> coverage(12 * 48);
    for (std::uint32_t y = 0; y < 48; ++y) {
      for (std::uint32_t x = 0; x < 96; ++x)
        for (std::uint32_t c = 0; c < channels; ++c)
          pixels.data.push_back(
              x < 40 ? static_cast<std::uint8_t>(90 + (x * 7 + y * 5 + c * 30) % 60 + random.next() % 6)
                     : static_cast<std::uint8_t>(random.next()));
      for (std::uint32_t x = 0; x < 5; ++x) coverage[y * 12 + x] = 0xff;
    }
    const Pixels before = pixels;
    fill_uncovered(pixels, coverage, {});
    const auto bytes = [](const Pixels& p) { return encode_jpeg(p, 75, Subsampling::k420).size(); };
    EXPECT_LT(bytes(pixels), bytes(before) / 2);
    for (std::uint32_t y = 0; y < 48; ++y)
      for (std::uint32_t x = 0; x < 96; ++x)
        for (std::uint32_t c = 0; c < channels; ++c) {
          if (x < 40) ASSERT_EQ(pixels.at(x, y)[c], before.at(x, y)[c]);
          if (x >= 48) ASSERT_EQ(pixels.at(x, y)[c], pixels.at(x / 16 * 16, y / 16 * 16)[c]) << x << " " << y;
        }
    // The block at columns 32..47 is half covered: no dearer than one that is wholly covered.
    const auto block = [&](std::uint32_t left) {
      Pixels out{16, 48, channels, {}};
      for (std::uint32_t y = 0; y < 48; ++y)
        out.data.insert(out.data.end(), pixels.at(left, y), pixels.at(left, y) + 16 * channels);
      return out;
    };
    EXPECT_LT(bytes(block(32)), bytes(block(16)));
  }
}

TEST(Fill, NothingCoveredChangesNothingAndBadCoverageIsRefused) {
  Pixels pixels = noise(20, 10, 3);
  const Pixels before = pixels;
  fill_uncovered(pixels, std::vector<std::uint8_t>(30), {});
  EXPECT_TRUE(pixels.data == before.data);
  EXPECT_THROW(fill_uncovered(pixels, std::vector<std::uint8_t>(29), {}), StageError);
  Pixels two = noise(8, 8, 2);
  EXPECT_THROW(fill_uncovered(two, std::vector<std::uint8_t>(8), {}), StageError);
}

// ---- planes from images ----

/// An uncompressed baseline TIFF of 8 bits: the simplest file with any number of channels.
Image tiff_of(const Pixels& pixels) {
  std::vector<std::uint8_t> b{'I', 'I', 42, 0, 8, 0, 0, 0};
  const auto put = [&b](std::uint32_t v, int bytes) {
    for (int k = 0; k < bytes; ++k) b.push_back(static_cast<std::uint8_t>(v >> (8 * k)));
  };
  const bool alpha = pixels.channels % 2 == 0;
  const std::uint32_t entries = alpha ? 11 : 10, bits_at = 8 + 2 + entries * 12 + 4, data_at = bits_at + 8;
  put(entries, 2);
  const auto entry = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t count, std::uint32_t value) {
    put(tag, 2), put(type, 2), put(count, 4), put(value, 4);
  };
  entry(256, 4, 1, pixels.width_px);
  entry(257, 4, 1, pixels.height_px);
  if (pixels.channels > 2)
    entry(258, 3, pixels.channels, bits_at);
  else
    entry(258, 3, pixels.channels, pixels.channels == 2 ? 8 | 8 << 16 : 8);
  entry(259, 3, 1, 1);
  entry(262, 3, 1, pixels.channels > 2 ? 2 : 1);
  entry(273, 4, 1, data_at);
  entry(277, 3, 1, pixels.channels);
  entry(278, 4, 1, pixels.height_px);
  entry(279, 4, 1, static_cast<std::uint32_t>(pixels.data.size()));
  entry(284, 3, 1, 1);
  if (alpha) entry(338, 3, 1, 2);
  put(0, 4);
  for (int k = 0; k < 4; ++k) put(8, 2);
  b.insert(b.end(), pixels.data.begin(), pixels.data.end());
  return probe_image("image.tif", b, {});
}

Fragments planes_of(const Image& image, std::vector<TextureRole> roles, std::uint32_t side = 16) {
  Fragments out;
  for (const TextureRole role : roles) {
    TexturePlane p;
    p.role = role;
    p.channels = role == TextureRole::kAlpha || image.channels < 3 ? 1 : 3;
    p.width_px = image.width_px;
    p.height_px = image.height_px;
    p.fragment_width_px = p.fragment_height_px = side;
    p.columns = (p.width_px + side - 1) / side;
    p.rows = (p.height_px + side - 1) / side;
    p.coverage = coverage_where(p.width_px, p.height_px, [](std::uint32_t, std::uint32_t) { return true; });
    out.planes.push_back(p);
  }
  return out;
}

TEST(FillPlanes, SplitsChannelsAndRepeatsEdges) {
  for (const std::uint32_t channels : {1u, 2u, 3u, 4u}) {
    const Pixels source = noise(21, 35, channels);
    const Image image = tiff_of(source);
    std::vector<TextureRole> roles{TextureRole::kBaseColour};
    if (channels % 2 == 0) roles.push_back(TextureRole::kAlpha);
    const Fragments fragments = planes_of(image, roles);
    const auto out = fill_planes(fragments, {image}, Fill::kPushPull, {});
    ASSERT_EQ(out.size(), roles.size());
    for (std::size_t p = 0; p < out.size(); ++p) {
      EXPECT_EQ(out[p].width_px, 32u);
      EXPECT_EQ(out[p].height_px, 48u);
      ASSERT_EQ(out[p].channels, p == 0 && channels >= 3 ? 3u : 1u);
      for (std::uint32_t y = 0; y < 48; ++y)
        for (std::uint32_t x = 0; x < 32; ++x)
          for (std::uint32_t c = 0; c < out[p].channels; ++c)
            ASSERT_EQ(out[p].at(x, y)[c],
                      source.at(std::min(x, 20u), std::min(y, 34u))[p == 1 ? channels - 1 : c]);
    }
  }
}

TEST(FillPlanes, BlocksBeyondTheImageAreFlat) {
  const Pixels source = noise(21, 35, 3);
  const Image image = tiff_of(source);
  const auto out =
      fill_planes(planes_of(image, {TextureRole::kBaseColour}, 64), {image}, Fill::kPushPull, {})[0];
  ASSERT_EQ(out.width_px, 64u);
  for (std::uint32_t y = 0; y < 48; ++y)
    for (std::uint32_t x = 0; x < 32; ++x)
      ASSERT_TRUE(std::equal(out.at(x, y), out.at(x, y) + 3, source.at(std::min(x, 20u), std::min(y, 34u))));
  for (std::uint32_t y = 0; y < 64; ++y)
    for (std::uint32_t x = 0; x < 64; ++x) {
      if (x < 32 && y < 48) continue;
      ASSERT_TRUE(std::equal(out.at(x, y), out.at(x, y) + 3, out.at(x / 16 * 16, y / 16 * 16)));
    }
  int sum = 0;  // the block right of the last column's second sixteen texels has their mean
  for (std::uint32_t y = 16; y < 32; ++y) sum += source.at(20, y)[1];
  EXPECT_NEAR(out.at(40, 20)[1], sum / 16.0, 0.51);
}

TEST(FillPlanes, FillsOnlyWhereAsked) {
  const Pixels source = noise(64, 64, 3);
  const Image image = tiff_of(source);
  Fragments fragments = planes_of(image, {TextureRole::kNormal});
  fragments.planes[0].coverage =
      coverage_where(64, 64, [](std::uint32_t x, std::uint32_t) { return x < 32; });
  EXPECT_TRUE(fill_planes(fragments, {image}, Fill::kNone, {})[0].data == source.data);
  const Pixels filled = fill_planes(fragments, {image}, Fill::kPushPull, {})[0];
  EXPECT_FALSE(filled.data == source.data);
  for (std::uint32_t y = 0; y < 64; ++y)
    EXPECT_TRUE(std::equal(filled.at(0, y), filled.at(32, y), source.at(0, y)));
}

TEST(FillPlanes, SameBytesForAnyNumberOfThreads) {
  const Image image = tiff_of(noise(500, 700, 3));
  Fragments fragments = planes_of(image, {TextureRole::kBaseColour});
  fragments.planes[0].coverage = coverage_where(
      500, 700, [](std::uint32_t x, std::uint32_t y) { return (x * x + y * y) / 5000 % 3 == 0; });
  RunContext one, eight;
  eight.threads = 8;
  EXPECT_TRUE(fill_planes(fragments, {image}, Fill::kPushPull, one)[0].data ==
              fill_planes(fragments, {image}, Fill::kPushPull, eight)[0].data);
}

TEST(FillPlanes, RefusesPlanesThatDoNotFitTheImage) {
  const Image image = tiff_of(noise(20, 20, 1));
  Fragments fragments = planes_of(image, {TextureRole::kBaseColour});
  EXPECT_THROW(fill_planes(fragments, {}, Fill::kNone, {}), StageError);
  fragments.planes[0].width_px = 21;
  EXPECT_THROW(fill_planes(fragments, {image}, Fill::kNone, {}), StageError);
  fragments = planes_of(image, {TextureRole::kAlpha});
  EXPECT_THROW(fill_planes(fragments, {image}, Fill::kNone, {}), StageError);
  EXPECT_TRUE(fill_planes({}, {}, Fill::kPushPull, {}).empty());
}

/// A model of one image with two mips; `seed` makes the picture.
Fragments with_mips(std::uint32_t w, std::uint32_t h, TextureRole role) {
  Fragments out;
  for (std::uint32_t mip = 0; mip < 3; ++mip) {
    TexturePlane p;
    p.role = role;
    p.mip = mip;
    p.width_px = (w + (1u << mip) - 1) >> mip;
    p.height_px = (h + (1u << mip) - 1) >> mip;
    p.fragment_width_px = (p.width_px + 15) / 16 * 16;
    p.fragment_height_px = (p.height_px + 15) / 16 * 16;
    p.columns = p.rows = 1;
    p.coverage.assign(coverage_size_bytes(p.width_px, p.height_px), 0xf0);
    out.planes.push_back(p);
  }
  return out;
}

TEST(Fill, MipsAreHalvesOfTheFinerPlane) {
  const Pixels source = noise(75, 50, 3);
  Image image;
  image.name = "a.png";
  image.bytes = write_png(source);
  image = probe_image("a.png", image.bytes, {});
  for (const auto& [role, kind] : {std::pair{TextureRole::kBaseColour, Averaging::kLight},
                                   {TextureRole::kNormal, Averaging::kNormals},
                                   {TextureRole::kData, Averaging::kNumbers}})
    for (const int threads : {1, 8}) {
      RunContext context;
      context.threads = threads;
      const Fragments fragments = with_mips(75, 50, role);
      const std::vector<Pixels> planes = fill_planes(fragments, {image}, Fill::kNone, context);
      ASSERT_EQ(planes.size(), 3u);
      for (std::size_t p = 1; p < 3; ++p) {
        const TexturePlane& finer = fragments.planes[p - 1];
        const Pixels want = halved(planes[p - 1], finer.width_px, finer.height_px, kind);
        EXPECT_EQ(planes[p].width_px, fragments.planes[p].fragment_width_px);
        for (std::uint32_t y = 0; y < want.height_px; ++y)
          for (std::uint32_t x = 0; x < want.width_px; ++x)
            for (std::uint32_t c = 0; c < 3; ++c) ASSERT_EQ(planes[p].at(x, y)[c], want.at(x, y)[c]);
      }
    }
}

/// Blocks that nobody sees are flat in every size, but what a mip shows near a chart comes from the smooth
/// fill.
TEST(Fill, MipsDoNotInheritFlatBlocks) {
  Pixels source{128, 128, 3, {}};
  for (int y = 0; y < 128; ++y)
    for (int x = 0; x < 128 * 3; ++x) source.data.push_back(static_cast<std::uint8_t>(2 * y));
  Image image = probe_image("a.png", write_png(source), {});
  Fragments fragments = with_mips(128, 128, TextureRole::kData);
  const auto cover_left = [](TexturePlane& p, std::uint32_t texels) {
    p.coverage = coverage_where(p.width_px, p.height_px, [=](auto x, auto) { return x < texels; });
  };
  cover_left(fragments.planes[0], 40);
  cover_left(fragments.planes[1], 28);
  cover_left(fragments.planes[2], 16);
  const std::vector<Pixels> one = fill_planes(fragments, {image}, Fill::kPushPull, {});
  for (std::uint32_t y = 4; y < 56; ++y) EXPECT_GT(one[1].at(26, y + 4)[0], one[1].at(26, y)[0]) << y;
  for (std::uint32_t y = 2; y < 28; ++y) EXPECT_GT(one[2].at(14, y + 2)[0], one[2].at(14, y)[0]) << y;
  RunContext eight;
  eight.threads = 8;
  const std::vector<Pixels> again = fill_planes(fragments, {image}, Fill::kPushPull, eight);
  for (std::size_t p = 0; p < 3; ++p) EXPECT_EQ(again[p].data, one[p].data);
}

TEST(Fill, PlanesThatDoNotFitEachOtherAreRefused) {
  Image image = probe_image("a.png", write_png(noise(75, 50, 3)), {});
  const auto refused = [&](auto change) {
    Fragments fragments = with_mips(75, 50, TextureRole::kData);
    change(fragments.planes);
    EXPECT_THROW(fill_planes(fragments, {image}, Fill::kNone, {}), StageError);
  };
  using P = std::vector<TexturePlane>&;
  refused([](P p) { p[1].base = 7; });
  refused([](P p) { p[2].mip = 3; });
  refused([](P p) { p[2].mip = 0; });
  refused([](P p) { p[1].width_px = 39; });
  refused([](P p) { p[1].role = TextureRole::kNormal; });
  refused([](P p) { p.erase(p.begin()); });
  refused([](P p) { p[2].image = 1; });
}

}  // namespace texmesh::fill_test
