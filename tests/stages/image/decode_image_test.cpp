#include "stages/image/decode_image.h"

#include <cmath>
#include <cstdlib>
#include <cstring>
#include <limits>
#include <numeric>

#include <gtest/gtest.h>
#include <webp/encode.h>
#include <zlib.h>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/image/image_metadata.h"
#include "tests/support/images.h"

namespace texmesh {
namespace {

using testing::encode_image;
using testing::jpeg_bytes;
using testing::png_bytes;
using testing::test_picture;
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

// --- PNGs of every kind, made by hand: OpenImageIO writes only some ------------------------------------

void put_chunk(Bytes& out, const char* type, const Bytes& data) {
  const std::size_t at = out.size();
  out.resize(at + 8);
  put32(out, at, static_cast<std::uint32_t>(data.size()));
  std::memcpy(out.data() + at + 4, type, 4);
  out.insert(out.end(), data.begin(), data.end());
  const std::uint32_t crc = crc32_of(out.data() + at + 4, data.size() + 4);
  out.resize(out.size() + 4);
  put32(out, out.size() - 4, crc);
}

/// `rows` are filter bytes and packed samples as they stand in the file before deflate.
Bytes make_png(std::uint32_t width, std::uint32_t height, std::uint8_t bits, std::uint8_t colour_type,
               std::uint8_t interlace, const Bytes& rows,
               const std::vector<std::pair<std::string, Bytes>>& chunks = {}) {
  Bytes png{0x89, 'P', 'N', 'G', '\r', '\n', 0x1a, '\n'};
  Bytes header(13, 0);
  put32(header, 0, width);
  put32(header, 4, height);
  header[8] = bits, header[9] = colour_type, header[12] = interlace;
  put_chunk(png, "IHDR", header);
  for (const auto& [type, data] : chunks) put_chunk(png, type.c_str(), data);
  uLongf size = compressBound(static_cast<uLong>(rows.size()));
  Bytes packed(size);
  EXPECT_EQ(compress(packed.data(), &size, rows.data(), static_cast<uLong>(rows.size())), Z_OK);
  packed.resize(size);
  put_chunk(png, "IDAT", packed);
  put_chunk(png, "IEND", {});
  return png;
}

TEST(DecodeImage, PngOfOneBitPaletteAndTransparentColour) {
  // 10 x 2, one bit: two bytes a row.
  const Bytes one_bit{0, 0b10100000, 0b01000000, 0, 0xff, 0xc0};
  Image image = probe(make_png(10, 2, 1, 0, 0, one_bit));
  EXPECT_EQ(image.channels, 1);
  EXPECT_EQ(decode_image(image).data, (Bytes{255, 0,   255, 0,   0,   0,   0,   0,   0,   255,  //
                                             255, 255, 255, 255, 255, 255, 255, 255, 255, 255}));
  const Bytes palette{10, 20, 30, 40, 50, 60, 70, 80, 90};
  const Bytes indices{0, 0b00011000};  // 2 bits: 0, 1, 2
  image = probe(make_png(3, 1, 2, 3, 0, indices, {{"PLTE", palette}}));
  EXPECT_EQ(image.channels, 3);
  EXPECT_EQ(decode_image(image).data, palette);
  image = probe(make_png(3, 1, 2, 3, 0, indices, {{"PLTE", palette}, {"tRNS", {0, 128}}}));
  EXPECT_EQ(image.channels, 4);
  EXPECT_EQ(decode_image(image).data, (Bytes{10, 20, 30, 0, 40, 50, 60, 128, 70, 80, 90, 255}));
  // Grey 200 is transparent.
  image = probe(make_png(2, 1, 8, 0, 0, {0, 200, 100}, {{"tRNS", {0, 200}}}));
  EXPECT_EQ(image.channels, 2);
  EXPECT_EQ(decode_image(image).data, (Bytes{200, 0, 100, 255}));
}

TEST(DecodeImage, PngGreyWithAlphaOfSixteenBits) {
  const Image image = probe(make_png(2, 1, 16, 4, 0, {0, 0x80, 0x80, 0xff, 0xff, 0x00, 0x7f, 0x12, 0x34}));
  EXPECT_EQ(image.channels, 2);
  EXPECT_EQ(image.bits_per_channel, 16);
  EXPECT_EQ(decode_image(image).data, (Bytes{128, 255, 0, 18}));
  EXPECT_EQ(decode_float(image).data, (std::vector<float>{0x8080, 0xffff, 0x7f, 0x1234}));
}

/// Whole pixels of `size` bytes, row by row, in the seven passes of Adam7; a pass without a pixel has no
/// rows.
Bytes interlaced_rows(const Bytes& pixels, int width, int height, int size) {
  constexpr int kX0[] = {0, 4, 0, 2, 0, 1, 0}, kY0[] = {0, 0, 4, 0, 2, 0, 1};
  constexpr int kDx[] = {8, 8, 4, 4, 2, 2, 1}, kDy[] = {8, 8, 8, 4, 4, 2, 2};
  Bytes rows;
  for (int pass = 0; pass < 7; ++pass)
    for (int y = kY0[pass]; y < height && kX0[pass] < width; y += kDy[pass]) {
      rows.push_back(0);
      for (int x = kX0[pass]; x < width; x += kDx[pass]) {
        const auto at = pixels.begin() + std::ptrdiff_t{y * width + x} * size;
        rows.insert(rows.end(), at, at + size);
      }
    }
  return rows;
}

Bytes plain_rows(const Bytes& pixels, int width, int height, int size) {
  Bytes rows;
  for (int y = 0; y < height; ++y) {
    const auto at = pixels.begin() + std::ptrdiff_t{y * width} * size;
    rows.push_back(0);
    rows.insert(rows.end(), at, at + std::ptrdiff_t{width} * size);
  }
  return rows;
}

TEST(DecodeImage, InterlacedPngOfEveryKindIsThePlainOne) {
  struct Kind {
    std::uint8_t colour_type;
    int channels;
  };
  for (const auto& [w, h] : {std::pair{13, 9}, {8, 8}, {3, 1}, {1, 5}})
    for (const Kind kind : {Kind{0, 1}, {2, 3}, {4, 2}, {6, 4}})
      for (const std::uint8_t bits : {std::uint8_t{8}, std::uint8_t{16}}) {
        const int size = kind.channels * bits / 8;
        Bytes pixels;  // of 16 bits both halves count
        for (int k = 0; k < w * h * size; ++k) pixels.push_back(static_cast<std::uint8_t>(k * 37 + k / 7));
        const auto file = [&](bool interlaced) {
          return make_png(static_cast<std::uint32_t>(w), static_cast<std::uint32_t>(h), bits,
                          kind.colour_type, interlaced,
                          interlaced ? interlaced_rows(pixels, w, h, size) : plain_rows(pixels, w, h, size));
        };
        const Image plain = probe(file(false)), passes = probe(file(true));
        EXPECT_EQ(passes.channels, kind.channels);
        EXPECT_EQ(passes.bits_per_channel, bits);
        EXPECT_EQ(decode_image(passes).data, decode_image(plain).data) << w << " x " << h;
        if (bits == 8) {
          EXPECT_EQ(decode_image(passes).data, pixels);
          continue;
        }
        std::vector<float> values;
        for (std::size_t k = 0; k < pixels.size(); k += 2)
          values.push_back(static_cast<float>(pixels[k] * 256 + pixels[k + 1]));
        EXPECT_EQ(decode_float(passes).data, values) << w << " x " << h;
      }
}

TEST(DecodeImage, InterlacedPngIsThePlainOne) {
  const Bytes samples = test_picture(8, 8, 1);
  const Bytes file = make_png(8, 8, 8, 0, 1, interlaced_rows(samples, 8, 8, 1));
  EXPECT_EQ(decode_image(probe(file)).data, samples);
  for (std::size_t n = 0; n + 16 < file.size(); ++n)
    EXPECT_THROW(decode_image(probe({file.begin(), file.begin() + static_cast<std::ptrdiff_t>(n)})),
                 InputError);
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

/// An uncompressed little-endian TIFF with its directory before the pixels, in strips of eight rows.
Bytes make_tiff(std::uint32_t width, std::uint32_t height, std::uint32_t channels, std::uint32_t bits,
                std::uint32_t photometric, const Bytes& samples) {
  constexpr std::uint32_t kRows = 8, kShort = 3, kLong = 4;
  const std::uint32_t strips = (height + kRows - 1) / kRows, row = width * channels * bits / 8;
  Bytes out{'I', 'I', 42, 0, 8, 0, 0, 0};
  const auto put = [&out](std::uint32_t value, int bytes) {
    for (int i = 0; i < bytes; ++i) out.push_back(static_cast<std::uint8_t>(value >> 8 * i));
  };
  constexpr std::uint32_t kEntries = 10;
  const std::uint32_t bits_at = 8 + 2 + 12 * kEntries + 4, offsets_at = bits_at + 2 * channels,
                      counts_at = offsets_at + 4 * strips, pixels_at = counts_at + 4 * strips;
  const auto entry = [&](std::uint32_t tag, std::uint32_t type, std::uint32_t count, std::uint32_t value) {
    put(tag, 2), put(type, 2), put(count, 4), put(value, 4);
  };
  put(kEntries, 2);
  entry(256, kLong, 1, width), entry(257, kLong, 1, height);
  entry(258, kShort, channels, channels > 2 ? bits_at : bits * 0x10001);
  entry(259, kShort, 1, 1), entry(262, kShort, 1, photometric);
  entry(273, kLong, strips, strips > 1 ? offsets_at : pixels_at), entry(277, kShort, 1, channels);
  entry(278, kLong, 1, kRows), entry(279, kLong, strips, strips > 1 ? counts_at : row * height);
  entry(284, kShort, 1, 1);
  put(0, 4);
  for (std::uint32_t c = 0; c < channels; ++c) put(bits, 2);
  for (std::uint32_t s = 0; s < strips; ++s) put(pixels_at + s * kRows * row, 4);
  for (std::uint32_t s = 0; s < strips; ++s) put(row * std::min(kRows, height - s * kRows), 4);
  out.insert(out.end(), samples.begin(), samples.end());
  return out;
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

TEST(DecodeImage, TiffOfOtherColoursIsConvertedOrRefused) {
  constexpr std::uint32_t kWhiteIsZero = 0, kRgb = 2, kInks = 5, kLab = 8;
  const auto filled = [](const Bytes& texel, std::size_t count) {
    Bytes samples;
    for (std::size_t i = 0; i < count; ++i) samples.insert(samples.end(), texel.begin(), texel.end());
    return samples;
  };
  const Image plain = probe(make_tiff(16, 12, 3, 8, kRgb, filled({10, 20, 30}, 16 * 12)));
  EXPECT_EQ(decode_image(plain).data, filled({10, 20, 30}, 16 * 12));
  const Image negative = probe(make_tiff(16, 12, 1, 8, kWhiteIsZero, filled({40}, 16 * 12)));
  EXPECT_EQ(decode_image(negative).data, filled({215}, 16 * 12));
  const Image inks = probe(make_tiff(16, 12, 4, 8, kInks, filled({255, 128, 0, 64}, 16 * 12)));
  EXPECT_TRUE(read_image_metadata(ImageFormat::kTiff, inks.bytes).cmyk);
  EXPECT_EQ(inks.channels, 3);
  const Pixels rgb = decode_image(inks);
  const int want[3] = {0, 95, 191};
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(rgb.data[c], want[c], 3) << c;
  const std::string lab = error_of([&] {
    probe(make_tiff(16, 12, 3, 8, kLab, filled({128, 0, 0}, 16 * 12)));
  });
  EXPECT_NE(lab.find("CIE L*a*b*"), std::string::npos) << lab;
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

TEST(DecodeImage, WebpThatClaimsMoreThanItHasNamesTheRow) {
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

TEST(DecodeImage, WebpOfOneColourIsSmallAndWhole) {
  Bytes samples;
  for (int i = 0; i < 512 * 512; ++i) samples.insert(samples.end(), {10, 20, 30});
  const Bytes webp = webp_bytes(512, 512, 3, samples);
  ASSERT_LT(webp.size(), samples.size() / 1000);
  EXPECT_EQ(decode_image(probe(webp)).data, samples);
}

/// Channel c is (c + 1) / 8 everywhere.
Bytes exr_of(const std::vector<std::string>& names, const OIIO::ImageSpec& attributes = {}) {
  const int n = static_cast<int>(names.size());
  OIIO::ImageSpec spec(4, 4, n, OIIO::TypeDesc::FLOAT);
  spec.extra_attribs = attributes.extra_attribs;
  spec.channelnames = names;
  std::vector<float> samples;
  for (int i = 0; i < 16 * n; ++i) samples.push_back(static_cast<float>(i % n + 1) / 8);
  std::vector<unsigned char> bytes;
  OIIO::Filesystem::IOVecOutput memory(bytes);
  auto output = OIIO::ImageOutput::create("openexr");
  output->set_ioproxy(&memory);
  EXPECT_TRUE(output->open("x.exr", spec) && output->write_image(OIIO::TypeDesc::FLOAT, samples.data()) &&
              output->close());
  return {bytes.begin(), bytes.end()};
}

TEST(DecodeImage, DepthOfAnExrIsNoAlpha) {
  using Names = std::vector<std::string>;
  for (const auto& [names, channels] : {std::pair{Names{"R", "G", "B", "Z"}, 3},
                                        {Names{"Y", "Z"}, 1},
                                        {Names{"R", "G", "B", "A"}, 4},
                                        {Names{"R", "G", "B", "A", "Z"}, 4},
                                        {Names{"R", "G", "B"}, 3},
                                        {Names{"Y"}, 1},
                                        {Names{"Y", "A"}, 2}}) {
    const Image image = probe(exr_of(names));
    EXPECT_EQ(image.channels, channels) << names.size() << names.back();
    EXPECT_EQ(decode_image(image).data.size(), 16u * static_cast<unsigned>(channels));
    if (channels % 2 == 1) {
      EXPECT_EQ(decode_image(image).data[0], 32);
    }
  }
}

TEST(DecodeImage, PrimariesOfAnExrAreSeen) {
  const auto primaries = [](std::vector<float> c) {
    OIIO::ImageSpec attributes;
    attributes.attribute("chromaticities", OIIO::TypeDesc(OIIO::TypeDesc::FLOAT, 8), c.data());
    return exr_of({"R", "G", "B"}, attributes);
  };
  const Bytes aces = primaries({0.7347f, 0.2653f, 0, 1, 0.0001f, -0.077f, 0.32168f, 0.33767f});
  EXPECT_TRUE(read_image_metadata(ImageFormat::kExr, aces).other_primaries);
  EXPECT_FALSE(read_image_metadata(ImageFormat::kExr,
                                   primaries({0.64f, 0.33f, 0.3f, 0.6f, 0.15f, 0.06f, 0.3127f, 0.329f}))
                   .other_primaries);
  EXPECT_FALSE(read_image_metadata(ImageFormat::kExr, exr_of({"R", "G", "B"})).other_primaries);
  for (std::size_t n = 0; n < aces.size(); ++n)
    read_image_metadata(ImageFormat::kExr, std::span(aces).first(n));
}

TEST(DecodeImage, JpegOfTwelveAndSixteenBitsIsRefused) {
  for (std::uint8_t bits : {std::uint8_t{12}, std::uint8_t{16}}) {
    Bytes jpeg = jpeg_bytes(16, 16, 3);
    for (std::size_t i = 0; i + 9 < jpeg.size(); ++i)
      if (jpeg[i] == 0xff && jpeg[i + 1] == 0xc0) {
        jpeg[i + 4] = bits;
        break;
      }
    const std::string error = error_of([&] { probe(jpeg); });
    EXPECT_NE(error.find("precision " + std::to_string(bits)), std::string::npos) << error;
  }
}

TEST(DecodeImage, CmykJpegBecomesRgb) {
  for (const bool adobe : {false, true}) {
    const Image image = probe(testing::cmyk_jpeg(16, 16, {255, 128, 0, 64}, adobe));
    EXPECT_EQ(image.channels, 3);
    const Pixels pixels = decode_image(image);
    // Adobe stores 255 - ink; ink 255, 128, 0 over black 64 leaves light (0, 127, 255) x 191 / 255.
    const int want[3] = {0, 95, 191};
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(pixels.data[c], want[c], 3) << adobe << c;
    EXPECT_TRUE(read_image_metadata(ImageFormat::kJpeg, image.bytes).cmyk);
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
