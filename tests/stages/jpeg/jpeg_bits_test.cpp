
#include <gtest/gtest.h>

#include <cmath>

#include "stages/jpeg/jpeg.h"
#include "stages/jpeg/masked_jpeg.h"
#include "tests/support/meshes.h"

namespace texmesh::jpeg_bits_test {

constexpr std::uint32_t kSide = 256;
const std::vector<int> kQualities{5, 20, 50, 57, 75, 80, 90, 97};

/// Shades, edges and grain that a JPEG of quality 85 has been before.
Pixels picture(std::uint32_t channels) {
  testing::Random random{11};
  Pixels out{kSide, kSide, channels, {}};
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        out.data.push_back(static_cast<std::uint8_t>(
            80 + (x * 3 + y * 2 + c * 40) % 67 + ((x / 23 + y / 17) % 3 == 0 ? 50 : 0) + random.next() % 24));
  return decode_jpeg(encode_jpeg(out, 85, Subsampling::k444), 1 << 20);
}

PixelWindow window_of(const Pixels& p, const std::vector<std::uint8_t>* coverage = nullptr) {
  PixelWindow out{p.data.data(), std::size_t{p.width_px} * p.channels, p.width_px, p.height_px, {}};
  if (coverage) out.coverage = {{*coverage, kSide, kSide}, 0, 0};
  return out;
}

/// Bits behind the scan header of a file with tables of its own.
double coded_bits(const Pixels& picture, JpegKind kind, int quality) {
  kind.quality = quality;
  const std::vector<std::uint8_t> file = JpegCoder(kind).complete(window_of(picture));
  std::size_t at = 2;
  while (file[at + 1] != 0xda) at += 2 + (file[at + 2] << 8 | file[at + 3]);
  const std::size_t begin = at + 2 + static_cast<std::size_t>(file[at + 2] << 8 | file[at + 3]);
  return 8.0 * static_cast<double>(file.size() - begin - 2);
}

TEST(JpegBits, AreThoseOfFilesWithTheBestTables) {
  for (const std::uint32_t channels : {1u, 3u})
    for (const Subsampling subsampling : {Subsampling::k420, Subsampling::k444}) {
      const Pixels p = picture(channels);
      JpegKind kind;
      kind.channels = channels;
      kind.subsampling = subsampling;
      const std::vector<PixelWindow> windows{window_of(p)};
      const std::vector<double> bits = jpeg_bits(kind, windows, kQualities, {});
      for (std::size_t q = 0; q < kQualities.size(); ++q)
        EXPECT_NEAR(bits[q] / coded_bits(p, kind, kQualities[q]), 1, 0.01)
            << channels << " channels at " << kQualities[q];
    }
}

TEST(JpegBits, OfTilesAreNearlyThoseOfTheWhole) {
  const Pixels p = picture(3);
  const PixelWindow whole = window_of(p);
  std::vector<PixelWindow> tiles;
  for (std::uint32_t y = 0; y < kSide; y += 16)
    for (std::uint32_t x = 0; x < kSide; x += 64)
      tiles.push_back({p.at(x, y), whole.stride_bytes, 64, 16, {}});
  const std::vector<double> a = jpeg_bits({}, std::span(&whole, 1), kQualities, {});
  const std::vector<double> b = jpeg_bits({}, tiles, kQualities, {});
  for (std::size_t q = 0; q < a.size(); ++q) EXPECT_NEAR(b[q] / a[q], 1, 0.01) << kQualities[q];
}

/// Chequers of 48 px: blocks that are covered, partly covered and not.
std::vector<std::uint8_t> chequers() {
  std::vector<std::uint8_t> out(kSide * kSide / 8);
  for (std::uint32_t y = 0; y < kSide; ++y)
    for (std::uint32_t x = 0; x < kSide; ++x)
      if ((x / 44 + y / 44) % 2 == 0) out[y * kSide / 8 + x / 8] |= static_cast<std::uint8_t>(0x80 >> x % 8);
  return out;
}

TEST(JpegBits, GrowWithQualityAsMaskedFilesDo) {
  const Pixels p = picture(3);
  const std::vector<std::uint8_t> coverage = chequers();
  const PixelWindow window = window_of(p, &coverage);
  const std::vector<double> bits = jpeg_bits({}, std::span(&window, 1), kQualities, {});
  const std::vector<double> plain = jpeg_bits({}, std::vector{window_of(p)}, kQualities, {});
  std::vector<MaskedRung> rungs;
  for (const int quality : kQualities) {
    JpegKind kind;
    kind.quality = quality;
    const JpegCoder coder(kind);
    rungs.push_back(masked_rung(kind, coder.quantisers(), coder.tables()));
  }
  std::vector<std::vector<std::uint8_t>> streams(rungs.size());
  MaskedJpeg({}).append_bodies(window, rungs, streams);
  // 57 lies where half the coefficients of the source stand half-way: files lose them.
  const auto ratio = [](double a, double b) { return std::log(a / b); };
  const double real = ratio(static_cast<double>(streams[3].size()), static_cast<double>(streams[4].size()));
  EXPECT_LT(std::fabs(ratio(bits[3], bits[4]) - real), 0.06);
  EXPECT_LT(bits[4], 0.8 * plain[4]);
}

TEST(JpegBits, NoneOfNothing) {
  EXPECT_EQ(jpeg_bits({}, {}, kQualities, {}), std::vector<double>(kQualities.size(), 0.0));
  const Pixels p = picture(3);
  const std::vector<std::uint8_t> none(kSide * kSide / 8);
  const PixelWindow window = window_of(p, &none);
  EXPECT_EQ(jpeg_bits({}, std::span(&window, 1), std::vector{50}, {}), std::vector<double>{0});
}

TEST(JpegBits, SameForAnyNumberOfThreads) {
  const Pixels p = picture(3);
  std::vector<PixelWindow> tiles;
  for (std::uint32_t y = 0; y < kSide; y += 16)
    for (std::uint32_t x = 0; x < kSide; x += 16)
      tiles.push_back({p.at(x, y), std::size_t{kSide} * 3, 16, 16, {}});
  RunContext one, eight;
  one.threads = 1;
  eight.threads = 8;
  EXPECT_EQ(jpeg_bits({}, tiles, kQualities, one), jpeg_bits({}, tiles, kQualities, eight));
}

}  // namespace texmesh::jpeg_bits_test
