#include "stages/fragment_codec/fragment_codec.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/jpeg/jpeg.h"

namespace texmesh::rebuilt_z_test {

/// All x and y, with that z.
Pixels all_pairs(std::uint8_t z) {
  Pixels out{256, 256, 3, {}};
  for (int y = 0; y < 256; ++y)
    for (int x = 0; x < 256; ++x)
      out.data.insert(out.data.end(), {static_cast<std::uint8_t>(x), static_cast<std::uint8_t>(y), z});
  return out;
}

PixelWindow whole(const Pixels& pixels) {
  return {pixels.data.data(), std::size_t{3} * pixels.width_px, pixels.width_px, pixels.height_px, {}};
}

double component(std::uint8_t byte) { return 2.0 * byte / 255 - 1; }

TEST(RebuiltZ, MakesTheLengthOne) {
  Pixels pixels = all_pairs(0);
  rebuild_z(pixels);
  for (std::size_t i = 0; i < pixels.data.size(); i += 3) {
    const double x = component(pixels.data[i]), y = component(pixels.data[i + 1]);
    const double z = std::sqrt(std::max(0.0, 1 - x * x - y * y));
    EXPECT_NEAR(component(pixels.data[i + 2]), z, 1.001 / 255) << x << ' ' << y;
  }
  // SPEC.md, F24, by hand: 255, 127 is beyond the circle, and 128 stands for the least z.
  EXPECT_EQ(pixels.data[3 * (127 * 256 + 255) + 2], 128);
  EXPECT_EQ(pixels.data[3 * (128 * 256 + 128) + 2], 255);
  EXPECT_EQ(pixels.data[3 * (64 * 256 + 128) + 2], 238);
}

TEST(RebuiltZ, LeavesGreyAlone) {
  Pixels grey{3, 1, 1, {1, 2, 3}};
  rebuild_z(grey);
  EXPECT_EQ(grey.data, (std::vector<std::uint8_t>{1, 2, 3}));
}

TEST(RebuiltZ, ShortVectorsKeepTheirDirection) {
  // (0.3, 0.4, 0.5) of any length.
  for (const double length : {0.5, 1.0, 1.4}) {
    Pixels pixels{1, 1, 3, {}};
    for (const double n : {0.3, 0.4, 0.5})
      pixels.data.push_back(static_cast<std::uint8_t>(std::lround((n * length + 1) * 127.5)));
    Pixels coded = without_z(whole(pixels));
    EXPECT_EQ(coded.data[2], 128);
    rebuild_z(coded);
    EXPECT_NEAR(component(coded.data[0]), 0.3 / std::sqrt(0.5), 0.02) << length;
    EXPECT_NEAR(component(coded.data[1]), 0.4 / std::sqrt(0.5), 0.02) << length;
    EXPECT_NEAR(component(coded.data[2]), 0.5 / std::sqrt(0.5), 0.02) << length;
  }
}

TEST(RebuiltZ, TheLongestVectorsStayWithinBytes) {
  const Pixels pixels{2, 1, 3, {255, 127, 127, 0, 128, 128}};
  const Pixels coded = without_z(whole(pixels));
  EXPECT_EQ(coded.data[0], 255);
  EXPECT_EQ(coded.data[3], 0);
}

TEST(RebuiltZ, TheCodecsFilesAreJpegsWithoutZ) {
  Pixels bumps{32, 32, 3, {}};
  for (int k = 0; k < 32 * 32; ++k) {
    const double u = 0.4 * std::sin(k % 32 / 5.0), v = 0.4 * std::cos(k / 32 / 4.0);
    for (const double n : {u, v, std::sqrt(1 - u * u - v * v)})
      bumps.data.push_back(static_cast<std::uint8_t>(std::lround((n + 1) * 127.5)));
  }
  PlaneCoding coding{3, 32, 32, true, false, true, Subsampling::k444, {97}};
  const auto codec = make_texture_codec(Codec::kJpeg, coding);
  EXPECT_EQ(codec->id(), Codec::kJpegXy);
  const Pixels coded = without_z(whole(bumps));
  const PixelWindow window = whole(coded);
  const std::vector<CodecRung> rungs = codec->train(std::span(&window, 1), RunContext{});
  std::vector<std::vector<std::uint8_t>> streams(1);
  codec->encoder()->encode(window, streams);
  const auto file = join_fragment(Codec::kJpegXy, rungs[0].table_stream, streams[0]);
  EXPECT_EQ(split_fragment(Codec::kJpegXy, rungs[0].table_stream, file, 0), streams[0]);
  const Pixels plain = decode_jpeg(file, 1024), shown = decode_fragment_file(Codec::kJpegXy, file, 1024);
  for (std::size_t i = 0; i < bumps.data.size(); ++i) {
    EXPECT_NEAR(shown.data[i], bumps.data[i], 6) << i;
    if (i % 3 == 2) EXPECT_EQ(plain.data[i], 128);
  }
}

}  // namespace texmesh::rebuilt_z_test
