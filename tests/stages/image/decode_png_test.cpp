#include "stages/image/png_writer.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "tests/stages/image/image_files.h"

namespace texmesh::decode_png_test {

using namespace testing;  // NOLINT: fixtures

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

TEST(DecodePng, PngOfOneBitPaletteAndTransparentColour) {
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

TEST(DecodePng, PngGreyWithAlphaOfSixteenBits) {
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

TEST(DecodePng, InterlacedPngOfEveryKindIsThePlainOne) {
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

TEST(DecodePng, InterlacedPngIsThePlainOne) {
  const Bytes samples = test_picture(8, 8, 1);
  const Bytes file = make_png(8, 8, 8, 0, 1, interlaced_rows(samples, 8, 8, 1));
  EXPECT_EQ(decode_image(probe(file)).data, samples);
  for (std::size_t n = 0; n + 16 < file.size(); ++n)
    EXPECT_THROW(decode_image(probe({file.begin(), file.begin() + static_cast<std::ptrdiff_t>(n)})),
                 InputError);
}

}  // namespace texmesh::decode_png_test
