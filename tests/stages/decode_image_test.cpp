#include "stages/decode_image.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>
#include <webp/encode.h>

#include "format/errors.h"
#include "tests/support/images.h"

namespace texmesh {
namespace {

using testing::encode_image;
using testing::jpeg_bytes;
using testing::png_bytes;
using testing::test_picture;
using Bytes = std::vector<std::uint8_t>;

Image probe(Bytes bytes) { return probe_image("test image", std::move(bytes), {}); }

// The error of `f`, or "" when there is none.
template <class F>
std::string error_of(F&& f) {
  try {
    f();
  } catch (const InputError& e) {
    return e.what();
  }
  return "";
}

int largest_difference(const Bytes& a, const Bytes& b) {
  int d = a.size() == b.size() ? 0 : 999;
  for (std::size_t i = 0; i < a.size() && i < b.size(); ++i) d = std::max(d, std::abs(a[i] - b[i]));
  return d;
}

void put32(Bytes& bytes, std::size_t at, std::uint32_t big_endian) {
  for (int i = 0; i < 4; ++i)
    bytes[at + static_cast<std::size_t>(i)] = static_cast<std::uint8_t>(big_endian >> (24 - 8 * i));
}

std::uint32_t crc32_of(const std::uint8_t* p, std::size_t n) {
  std::uint32_t c = ~0u;
  for (std::size_t i = 0; i < n; ++i) {
    c ^= p[i];
    for (int k = 0; k < 8; ++k) c = c >> 1 ^ (c & 1 ? 0xedb88320u : 0);
  }
  return ~c;
}

// Lossless, with the colours of transparent texels kept.
Bytes webp_bytes(int width, int height, int channels, const Bytes& samples) {
  WebPConfig config;
  WebPPicture picture;
  WebPMemoryWriter memory;
  WebPMemoryWriterInit(&memory);
  EXPECT_TRUE(WebPConfigInit(&config) && WebPPictureInit(&picture));
  config.lossless = config.exact = 1;
  picture.use_argb = 1;
  picture.width = width;
  picture.height = height;
  picture.writer = WebPMemoryWrite;
  picture.custom_ptr = &memory;
  EXPECT_TRUE((channels == 4 ? WebPPictureImportRGBA : WebPPictureImportRGB)(&picture, samples.data(),
                                                                             width * channels));
  EXPECT_TRUE(WebPEncode(&config, &picture));
  const Bytes bytes(memory.mem, memory.mem + memory.size);
  WebPPictureFree(&picture);
  WebPMemoryWriterClear(&memory);
  return bytes;
}

// A PNG whose header claims another size, with a right checksum.
Bytes png_claiming(std::uint32_t width, std::uint32_t height) {
  Bytes png = png_bytes(8, 8, 3);
  put32(png, 16, width);
  put32(png, 20, height);
  put32(png, 29, crc32_of(png.data() + 12, 17));
  return png;
}

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

TEST(DecodeImage, JpegIsCloseAndRowsAreTopFirst) {
  for (int channels : {1, 3}) {
    Bytes samples(64 * 48 * static_cast<std::size_t>(channels));
    for (std::size_t i = 0; i < samples.size(); ++i)
      samples[i] = static_cast<std::uint8_t>(i * 255 / samples.size());
    OIIO::ImageSpec attributes;
    attributes.attribute("Compression", "jpeg:98");
    const Image image =
        probe(encode_image("jpeg", 64, 48, channels, samples, OIIO::TypeDesc::UINT8, attributes));
    EXPECT_EQ(image.channels, channels);
    EXPECT_LE(largest_difference(decode_image(image).data, samples), 6);
  }
}

TEST(DecodeImage, WebpLossless) {
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

TEST(DecodeImage, FloatsKeepTheirRangeAndColoursAreEncoded) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  const std::vector<float> samples{0, 0.5f, 1, -1, 2, 1000.25f, nan, inf, 0.0021f, 0.214f, 0.25f, -inf};
  for (const char* writer : {"openexr", "tiff"}) {
    const Image image = probe(encode_image(writer, 2, 2, 3, samples, OIIO::TypeDesc::FLOAT));
    EXPECT_EQ(image.bits_per_channel, 32);
    const FloatPixels floats = decode_float(image);
    ASSERT_EQ(floats.data.size(), samples.size());
    for (std::size_t i = 0; i < samples.size(); ++i)
      if (!std::isnan(samples[i])) {
        EXPECT_EQ(floats.data[i], samples[i]) << writer << i;
      }
    EXPECT_EQ(decode_image(image).data, (Bytes{0, 128, 255, 0, 255, 255, 0, 255, 1, 55, 64, 0})) << writer;
    EXPECT_EQ(decode_image(image, FloatEncoding::kSrgb).data,
              (Bytes{0, 188, 255, 0, 255, 255, 0, 255, 7, 127, 137, 0}))
        << writer;
  }
}

TEST(DecodeImage, HalfFloatsAndAlphaOfExr) {
  const std::vector<float> samples{0.5f, 0.25f, 0.125f, 0.5f};
  const Image image = probe(encode_image("openexr", 1, 1, 4, samples, OIIO::TypeDesc::FLOAT));
  const Pixels srgb = decode_image(image, FloatEncoding::kSrgb);
  EXPECT_EQ(srgb.data[3], 128) << "alpha is never encoded";
}

TEST(DecodeImage, PalettesAndFewBitsExpand) {
  Bytes samples(64 * 64, 0);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = i % 3 ? 255 : 0;
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:BitsPerSample", 1);
  const Image image = probe(encode_image("tiff", 64, 64, 1, samples, OIIO::TypeDesc::UINT8, attributes));
  EXPECT_EQ(decode_image(image).data, samples);
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

TEST(DecodeImage, AnImageThatChangedAfterImportIsRefused) {
  Image image = probe(png_bytes(8, 8, 3));
  image.width_px = 7;
  EXPECT_THROW(decode_image(image), InputError);
  image = probe(jpeg_bytes(8, 8, 3));
  image.channels = 1;
  EXPECT_THROW(decode_image(image), InputError);
}

}  // namespace
}  // namespace texmesh
