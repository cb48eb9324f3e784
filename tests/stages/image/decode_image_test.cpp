#include "stages/image/decode_image.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "tests/stages/image/image_files.h"
#include "tests/stages/image/tiff_files.h"

namespace texmesh::decode_image_test {

using namespace testing;  // NOLINT: fixtures

TEST(DecodeImage, SniffsTheAllowListOnly) {
  EXPECT_EQ(sniff_image_format(png_bytes(2, 2, 3)), ImageFormat::kPng);
  EXPECT_EQ(sniff_image_format(jpeg_bytes(2, 2, 3)), ImageFormat::kJpeg);
  for (const char* other : {"P6\n2 2\n255\nabcdefghijkl", "GIF89a......", "BM............", "#?RADIANCE\n",
                            "", "\xff\xd8", "RIFF....WAVE", "DDS "}) {
    const Bytes bytes(other, other + std::strlen(other));
    EXPECT_FALSE(sniff_image_format(bytes)) << other;
    EXPECT_THROW(probe(bytes), InputError) << other;
  }
  // A Targa has no magic: 18 bytes of header, then pixels.
  Bytes tga(18 + 12, 0);
  tga[2] = 2, tga[12] = 2, tga[14] = 2, tga[16] = 24;
  EXPECT_THROW(probe(tga), InputError);
}

TEST(DecodeImage, LosslessFormatsGiveTheSamplesBack) {
  for (const char* writer : {"png", "tiff"})
    for (int channels : {1, 2, 3, 4}) {
      const Bytes samples = test_picture(37, 23, channels);
      OIIO::ImageSpec attributes;
      attributes.attribute("oiio:UnassociatedAlpha", 1);
      const Image image =
          probe(encode_image(writer, 37, 23, channels, samples, OIIO::TypeDesc::UINT8, attributes));
      EXPECT_EQ(image.width_px, 37u);
      EXPECT_EQ(image.height_px, 23u);
      EXPECT_EQ(image.channels, channels) << writer;
      EXPECT_EQ(image.bits_per_channel, 8);
      const Pixels pixels = decode_image(image);
      EXPECT_EQ(pixels.channels, static_cast<std::uint32_t>(channels));
      EXPECT_EQ(pixels.data, samples) << writer << " " << channels;
      EXPECT_EQ(decode_image(image).data, pixels.data) << "a second run";
    }
}

TEST(DecodeImage, TransparentTexelsKeepTheirColour) {
  const Bytes samples{200, 100, 50, 0, 10, 20, 30, 128};
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:UnassociatedAlpha", 1);
  for (const char* writer : {"png", "tiff"})
    EXPECT_EQ(
        decode_image(probe(encode_image(writer, 2, 1, 4, samples, OIIO::TypeDesc::UINT8, attributes))).data,
        samples)
        << writer;
}

TEST(DecodeImage, SixteenBitsAreRoundedNotCut) {
  std::vector<std::uint16_t> samples(65536 / 16 * 3);
  for (std::size_t i = 0; i < samples.size(); ++i)
    samples[i] = static_cast<std::uint16_t>(i * 16 / 3 * 1 + i % 3);
  for (const char* writer : {"png", "tiff"}) {
    const Image image = probe(encode_image(writer, 64, 64, 3, samples, OIIO::TypeDesc::UINT16));
    EXPECT_EQ(image.bits_per_channel, 16);
    const Pixels pixels = decode_image(image);
    const FloatPixels floats = decode_float(image);
    for (std::size_t i = 0; i < samples.size(); ++i) {
      ASSERT_EQ(pixels.data[i], std::lround(samples[i] * 255.0 / 65535.0)) << samples[i];
      ASSERT_EQ(floats.data[i], samples[i]);
    }
  }
}

TEST(DecodeImage, LimitsAreCheckedOnTheHeader) {
  ImageLimits limits;
  limits.max_side_px = 16;
  EXPECT_THROW(probe_image("x", png_bytes(17, 4, 3), limits), InputError);
  EXPECT_THROW(probe_image("x", jpeg_bytes(4, 17, 3), limits), InputError);
  EXPECT_NO_THROW(probe_image("x", jpeg_bytes(16, 16, 3), limits));
  limits = {};
  limits.max_pixels = 100;
  EXPECT_THROW(probe_image("x", png_bytes(11, 10, 3), limits), InputError);
  EXPECT_NO_THROW(probe_image("x", png_bytes(10, 10, 3), limits));
  const std::string error = error_of([&] { probe_image("x.png", png_bytes(11, 10, 3), limits); });
  EXPECT_NE(error.find("x.png"), std::string::npos) << error;
  EXPECT_NE(error.find("11 x 10"), std::string::npos) << error;
}

TEST(DecodeImage, HeadersThatLieAreRefused) {
  EXPECT_THROW(probe(png_claiming(65001, 65001)), InputError) << "beyond the limits";
  EXPECT_THROW(probe(png_claiming(0, 8)), InputError);
  for (auto [w, h] : {std::pair{19000u, 20000u}, {8u, 9u}, {8u, 100000u / 2}, {5000u, 8u}})
    EXPECT_NE(error_of([&, width = w, height = h] { decode_image(probe(png_claiming(width, height))); }), "")
        << w << " x " << h;
  Bytes jpeg = jpeg_bytes(32, 32, 3);
  for (std::size_t i = 0; i + 9 < jpeg.size(); ++i)
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {
      jpeg[i + 5] = 0x40, jpeg[i + 6] = 0, jpeg[i + 7] = 0x40, jpeg[i + 8] = 0;  // 16384 x 16384
      break;
    }
  const Image image = probe(jpeg);
  EXPECT_EQ(image.width_px, 16384u);
  EXPECT_THROW(decode_image(image), InputError);
}

TEST(DecodeImage, EveryTruncationIsAnError) {
  OIIO::ImageSpec zip;
  zip.attribute("compression", "zip");
  const std::vector<float> floats(12 * 12 * 3, 0.25f);
  const std::pair<const char*, Bytes> files[] = {
      {"png", png_bytes(12, 12, 3)},
      {"jpeg", jpeg_bytes(12, 12, 3)},
      {"tiff", encode_image("tiff", 12, 12, 3, test_picture(12, 12, 3), OIIO::TypeDesc::UINT8, zip)},
      {"webp", webp_bytes(12, 12, 3, test_picture(12, 12, 3))},
      {"exr", encode_image("openexr", 12, 12, 3, floats, OIIO::TypeDesc::FLOAT, zip)}};
  for (const auto& [name, whole] : files) {
    const Bytes decoded = decode_image(probe(whole)).data;
    int accepted = 0;
    for (std::size_t n = 0; n < whole.size(); ++n) try {
        // What a shorter file gives at all must be the whole picture: only trailing bytes without pixels may
        // be missing.
        EXPECT_EQ(decode_image(probe({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)})).data,
                  decoded)
            << name << " cut to " << n << " of " << whole.size();
        ++accepted;
      } catch (const InputError&) {
      }
    EXPECT_LE(accepted, 40) << name;
  }
}

TEST(DecodeImage, FlippedBytesNeverHarm) {
  const std::vector<float> floats(12 * 12 * 3, 0.25f);
  const Bytes files[] = {png_bytes(12, 12, 4), jpeg_bytes(12, 12, 3),
                         encode_image("tiff", 12, 12, 3, test_picture(12, 12, 3), OIIO::TypeDesc::UINT8),
                         webp_bytes(12, 12, 3, test_picture(12, 12, 3)),
                         encode_image("openexr", 12, 12, 3, floats, OIIO::TypeDesc::FLOAT)};
  ImageLimits limits;
  limits.max_pixels = 1 << 20;  // what a flipped size may claim, so that the sweep stays small
  for (const Bytes& whole : files)
    for (std::size_t i = 0; i < whole.size(); ++i)
      for (int bit : {0, 3, 7}) {
        Bytes bytes = whole;
        bytes[i] = static_cast<std::uint8_t>(bytes[i] ^ 1 << bit);
        try {
          const Image image = probe_image("flipped", bytes, limits);
          const Pixels pixels = decode_image(image);
          ASSERT_EQ(pixels.data.size(),
                    static_cast<std::size_t>(image.width_px) * image.height_px * image.channels);
        } catch (const InputError&) {
        }
      }
}

TEST(DecodeImage, OddSizes) {
  for (auto [w, h] : {std::pair{1, 1}, {15, 4097}, {4097, 15}})
    for (const char* writer : {"png", "jpeg", "tiff"}) {
      const Bytes samples = test_picture(w, h, 3);
      const Image image = probe(encode_image(writer, w, h, 3, samples, OIIO::TypeDesc::UINT8));
      EXPECT_EQ(image.width_px, static_cast<std::uint32_t>(w));
      EXPECT_EQ(image.height_px, static_cast<std::uint32_t>(h));
      const Pixels pixels = decode_image(image);
      EXPECT_EQ(pixels.data.size(), samples.size());
      if (writer != std::string("jpeg")) {
        EXPECT_EQ(pixels.data, samples) << writer;
      }
    }
}

TEST(DecodeImage, TruncationNamesTheFileAndTheRow) {
  constexpr std::uint32_t kRgb = 2;
  const Bytes samples = test_picture(64, 200, 3);
  OIIO::ImageSpec progressive;
  progressive.attribute("jpeg:progressive", 1);
  const std::pair<const char*, Bytes> files[] = {
      {": scan ", encode_image("jpeg", 64, 200, 3, samples, OIIO::TypeDesc::UINT8, progressive)},
      {": row ", webp_bytes(64, 200, 3, samples)},
      {": row ", webp_bytes(64, 200, 4, test_picture(64, 200, 4))},
      {"row ", encode_image("png", 64, 200, 3, samples, OIIO::TypeDesc::UINT8)},
      {"row ", encode_image("jpeg", 64, 200, 3, samples, OIIO::TypeDesc::UINT8)},
      {"rows ", make_tiff(64, 200, 3, 8, kRgb, samples)}};
  for (const auto& [row, file] : files) {
    Image cut = probe(file);
    cut.bytes.resize(cut.bytes.size() * 3 / 5);
    const std::string error = error_of([&] { decode_image(cut); });
    EXPECT_NE(error.find("test image"), std::string::npos) << error;
    EXPECT_NE(error.find(row), std::string::npos) << error;
    EXPECT_NE(error.find("of 200"), std::string::npos) << error;
  }
}

TEST(DecodeImage, SixtyFiveThousandByTheSameCostsNothing) {
  ImageLimits limits;
  limits.max_pixels = 1ull << 40;
  Bytes png = png_claiming(65000, 65000);
  EXPECT_NE(error_of([&] { decode_image(probe_image("big.png", png, limits)); }).find("big.png"),
            std::string::npos);
  Bytes jpeg = jpeg_bytes(32, 32, 1);
  for (std::size_t i = 0; i + 9 < jpeg.size(); ++i)
    if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {
      jpeg[i + 5] = 0xfd, jpeg[i + 6] = 0xe8, jpeg[i + 7] = 0xfd, jpeg[i + 8] = 0xe8;
      break;
    }
  EXPECT_THROW(probe_image("big.jpg", jpeg, {}), InputError) << "beyond the limit of pixels";
  const std::string error = error_of([&] { decode_image(probe_image("big.jpg", jpeg, limits)); });
  EXPECT_NE(error.find("of 65000"), std::string::npos) << error;
}

TEST(DecodeImage, AnImageThatChangedAfterImportIsRefused) {
  Image image = probe(png_bytes(8, 8, 3));
  image.width_px = 7;
  EXPECT_THROW(decode_image(image), InputError);
  image = probe(jpeg_bytes(8, 8, 3));
  image.channels = 1;
  EXPECT_THROW(decode_image(image), InputError);
}

}  // namespace texmesh::decode_image_test
