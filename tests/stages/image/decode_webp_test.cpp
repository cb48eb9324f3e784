#include "stages/image/webp.h"

#include <gtest/gtest.h>

#include "tests/stages/image/image_files.h"

namespace texmesh::decode_webp_test {

using namespace testing;  // NOLINT: fixtures

TEST(DecodeWebp, WebpLossless) {
  for (int channels : {3, 4}) {
    const Bytes samples = test_picture(40, 30, channels);  // alpha 0 with colour under it included
    const Bytes file = webp_bytes(40, 30, channels, samples);
    const Image image = probe(file);
    EXPECT_EQ(image.format, ImageFormat::kWebp);
    EXPECT_EQ(image.width_px, 40u);
    EXPECT_EQ(image.height_px, 30u);
    const Pixels pixels = decode_image(image);
    ASSERT_EQ(pixels.channels, static_cast<std::uint32_t>(channels));
    EXPECT_EQ(pixels.data, samples) << channels;
    ImageLimits small;
    small.max_side_px = 39;
    EXPECT_THROW(probe_image("w", file, small), InputError);
  }
}

TEST(DecodeWebp, WebpThatClaimsMoreThanItHasNamesTheRow) {
  Bytes webp = webp_bytes(8, 8, 3, test_picture(8, 8, 3));
  ASSERT_EQ(webp[20], 0x2f);
  const std::uint32_t sides = 16382u | 16382u << 14;  // less 1, 14 bits each
  for (int i = 0; i < 4; ++i)
    webp[21 + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(
        (i == 3 ? webp[24] & 0xf0u : 0u) | (sides >> (8 * i) & (i == 3 ? 0x0fu : 0xffu)));
  const Image image = probe(webp);
  ASSERT_EQ(image.width_px, 16383u);
  const std::string error = error_of([&] { decode_image(image); });
  EXPECT_NE(error.find("row "), std::string::npos) << error;
  EXPECT_NE(error.find("of 16383"), std::string::npos) << error;
}

TEST(DecodeWebp, WebpOfOneColourIsSmallAndWhole) {
  Bytes samples;
  for (int i = 0; i < 512 * 512; ++i) samples.insert(samples.end(), {10, 20, 30});
  const Bytes webp = webp_bytes(512, 512, 3, samples);
  ASSERT_LT(webp.size(), samples.size() / 1000);
  EXPECT_EQ(decode_image(probe(webp)).data, samples);
}

TEST(EncodeWebp, OptionsCountAndWhatPackagesHoldComesBack) {
  const Pixels rgb{40, 30, 3, test_picture(40, 30, 3)};
  const Bytes plain = encode_webp(rgb, {80}), again = encode_webp(rgb, {80});
  EXPECT_EQ(plain, again);
  EXPECT_LT(encode_webp(rgb, {10}).size(), plain.size());
  EXPECT_NE(encode_webp(rgb, {80, 100, 6}), plain);
  EXPECT_LT(encode_webp(rgb, {10, 100, 4, true}).size(), encode_webp(rgb, {10}).size());
  const Pixels back = decode_lossy_webp(plain, 40 * 30);
  EXPECT_EQ(back.width_px, 40u);
  EXPECT_EQ(back.channels, 3u);
  EXPECT_EQ(decode_webp_rgba(plain).channels, 4u);
  EXPECT_THROW(decode_lossy_webp(plain, 40 * 30 - 1), FormatError);
  EXPECT_THROW(decode_lossy_webp(encode_webp({40, 30, 4, test_picture(40, 30, 4)}, {80}), 1200), FormatError);
  const Pixels grey{8, 8, 1, Bytes(64, 77)};
  EXPECT_NEAR(decode_lossy_webp(encode_webp(grey, {90}), 64).at(3, 3)[2], 77, 3);
  EXPECT_THROW(encode_webp({16384, 1, 3, Bytes(3 * 16384)}, {80}), StageError);
  Bytes two{1, 2};
  append_webp({rgb.data.data(), 120, 40, 30}, 3, {80}, two);
  EXPECT_EQ(Bytes(two.begin() + 2, two.end()), plain);
}

}  // namespace texmesh::decode_webp_test
