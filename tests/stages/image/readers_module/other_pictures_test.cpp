#include "stages/image/readers_module/other_pictures.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "tests/stages/image/image_files.h"

namespace texmesh::other_pictures_test {

using namespace testing;  // NOLINT: fixtures

Image converted(const std::string& name, const Bytes& bytes, ConvertedPicture* picture = nullptr) {
  const auto kind = sniff_other_picture(name, bytes);
  if (!kind) throw InputError(name, "", "a known picture", "another one");
  ConvertedPicture out = convert_other_picture(name, *kind, bytes, {});
  Image image = probe_image(name, out.bytes, {});
  if (picture) *picture = std::move(out);
  return image;
}

Bytes in_format(const std::string& writer, int width, int height, int channels) {
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:UnassociatedAlpha", 1);
  return encode_image(writer, width, height, channels, test_picture(width, height, channels),
                      OIIO::TypeDesc::UINT8, attributes);
}

/// A DDS of 32 bits a texel, blue first; `fourcc` for blocks instead.
Bytes dds_of(std::uint32_t width, std::uint32_t height, std::string_view fourcc, const Bytes& data,
             std::uint32_t caps2 = 0) {
  BytesOut out;
  out.text("DDS "), out.u32(124), out.u32(0x1007), out.u32(height), out.u32(width);
  for (int i = 0; i < 14; ++i) out.u32(0);
  out.u32(32), out.u32(fourcc.empty() ? 0x41 : 4),
      out.text(fourcc.empty() ? std::string_view("\0\0\0\0", 4) : fourcc);
  if (fourcc.empty())
    out.u32(32), out.u32(0xff0000), out.u32(0xff00), out.u32(0xff), out.u32(0xff000000);
  else
    for (int i = 0; i < 5; ++i) out.u32(0);
  out.u32(0x1000), out.u32(caps2);
  for (int i = 0; i < 3; ++i) out.u32(0);
  out.raw(data);
  return out.finish();
}

/// A BMP of 32 bits a texel whose fourth byte says nothing; height below 0: rows from the top.
Bytes bmp_of_32_bits(std::int32_t width, std::int32_t height, const Bytes& data) {
  BytesOut out;
  out.text("BM"), out.u32(54 + data.size()), out.u32(0), out.u32(54), out.u32(40);
  out.u32(static_cast<std::uint32_t>(width)), out.u32(static_cast<std::uint32_t>(height));
  out.u16(1), out.u16(32), out.u32(0), out.u32(data.size());
  for (int i = 0; i < 4; ++i) out.u32(0);
  out.raw(data);
  return out.finish();
}

TEST(OtherPictures, TexelsStayTheSame) {
  for (const auto& [writer, name] : {std::pair{"bmp", "a.bmp"}, {"targa", "a.tga"}, {"jpeg2000", "a.jp2"}}) {
    const Image image = converted(name, in_format(writer, 97, 71, 3));
    EXPECT_EQ(image.format, ImageFormat::kPng) << name;
    EXPECT_EQ(image.width_px, 97u);
    EXPECT_EQ(image.height_px, 71u);
    const int difference = largest_difference(decode_image(image).data, test_picture(97, 71, 3));
    EXPECT_LE(difference, std::string(writer) == "jpeg2000" ? 24 : 0) << name;
  }
}

TEST(OtherPictures, AlphaIsKeptWhereItSaysSomething) {
  const Image kept = converted("a.tga", in_format("targa", 16, 16, 4));
  EXPECT_EQ(kept.channels, 4);
  EXPECT_LE(largest_difference(decode_image(kept).data, test_picture(16, 16, 4)), 1);
  for (const std::uint8_t alpha : {std::uint8_t{0}, std::uint8_t{255}}) {
    Bytes samples = test_picture(16, 16, 3), bgra;
    for (std::size_t y = 16; y-- > 0;)  // rows from the bottom
      for (std::size_t x = 0; x < 16; ++x)
        for (const std::size_t c : {2, 1, 0, 3})
          bgra.push_back(c == 3 ? alpha : samples[(y * 16 + x) * 3 + c]);
    const Image image = converted("a.bmp", bmp_of_32_bits(16, 16, bgra));
    EXPECT_EQ(image.channels, 3);
    EXPECT_EQ(decode_image(image).data, samples);
  }
}

TEST(OtherPictures, BmpsMayBeginWithTheirFirstRow) {
  const Image image = converted("a.bmp", bmp_of_32_bits(1, -2, {1, 2, 3, 0, 4, 5, 6, 0}));
  EXPECT_EQ(decode_image(image).data, (Bytes{3, 2, 1, 6, 5, 4}));
}

TEST(OtherPictures, TgasHaveNoFirstBytesOfTheirOwn) {
  const Bytes tga = in_format("targa", 8, 8, 3);
  EXPECT_EQ(sniff_other_picture("A.TGA", tga), OtherPicture::kTga);
  EXPECT_FALSE(sniff_other_picture("a.xyz", tga).has_value());
  EXPECT_FALSE(sniff_other_picture("a.tga", Bytes(100, 'x')).has_value());
  EXPECT_FALSE(sniff_other_picture("a.tga", Bytes(10, 0)).has_value());
}

TEST(OtherPictures, OfAGifTheFirstPicture) {
  const Bytes gif{'G', 'I', 'F', '8', '9', 'a', 2, 0, 1, 0, 0x80, 0, 0, 10, 20, 30, 200, 100, 50};
  const Bytes frame{0x2c, 0, 0, 0, 0, 2, 0, 1, 0, 0, 2, 2, 0x44, 0x0a, 0};  // colours 0 and 1
  Bytes one = gif, two = gif;
  one.insert(one.end(), frame.begin(), frame.end()), one.push_back(0x3b);
  for (int i = 0; i < 2; ++i) two.insert(two.end(), frame.begin(), frame.end());
  two.push_back(0x3b);
  for (const Bytes& bytes : {one, two}) {
    ConvertedPicture picture;
    const Image image = converted("a.gif", bytes, &picture);
    EXPECT_EQ(decode_image(image).data, (Bytes{10, 20, 30, 200, 100, 50}));
    EXPECT_EQ(picture.more_pictures, bytes == two);
  }
}

TEST(OtherPictures, DdsPlainAndInBlocks) {
  const Image plain = converted("a.dds", dds_of(2, 1, "", {1, 2, 3, 9, 4, 5, 6, 8}));
  EXPECT_EQ(decode_image(plain).data, (Bytes{3, 2, 1, 9, 6, 5, 4, 8}));
  // BC1: two colours of 16 bits, red and blue, and two bits for each texel: all red but for a blue row.
  const Image blocks = converted("a.dds", dds_of(4, 4, "DXT1", {0, 0xf8, 0x1f, 0, 0x55, 0, 0, 0}));
  const Bytes texels = decode_image(blocks).data;
  const std::size_t n = blocks.channels;
  ASSERT_EQ(texels.size(), 16 * n);
  EXPECT_EQ((Bytes{texels[0], texels[1], texels[2]}), (Bytes{0, 0, 255}));
  EXPECT_EQ((Bytes{texels[4 * n], texels[4 * n + 1], texels[4 * n + 2]}), (Bytes{255, 0, 0}));
  // BC5: x and y of a normal that looks up have a z of 1.
  Bytes up;
  for (int k = 0; k < 2; ++k) up.insert(up.end(), {128, 128, 0, 0, 0, 0, 0, 0});
  const Image normals = converted("a.dds", dds_of(4, 4, "ATI2", up));
  ASSERT_EQ(normals.channels, 3);
  EXPECT_GE(decode_image(normals).data[2], 254);
  for (const std::uint32_t caps : {0xfe00u, 0x200000u})
    EXPECT_NE(error_of([&] { converted("a.dds", dds_of(4, 4, "DXT1", Bytes(48, 0), caps)); }).find("flat"),
              std::string::npos);
}

TEST(OtherPictures, HdrIsLight) {
  const std::vector<float> samples{0.5f, 0.25f, 1, 2, 0, 0.125f};
  const Image image = converted("a.hdr", encode_image("hdr", 2, 1, 3, samples, OIIO::TypeDesc::FLOAT));
  EXPECT_EQ(image.bits_per_channel, 32);
  EXPECT_EQ(image.format, ImageFormat::kTiff);
  const FloatPixels floats = decode_float(image);
  ASSERT_EQ(floats.data.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) EXPECT_NEAR(floats.data[i], samples[i], 0.01f) << i;
  EXPECT_NEAR(decode_image(image, FloatEncoding::kSrgb).data[0], 188, 1);
  EXPECT_NEAR(decode_image(image).data[0], 128, 1);
}

TEST(OtherPictures, SixteenBitsStay) {
  std::vector<std::uint16_t> samples;
  for (int i = 0; i < 64 * 64; ++i) samples.push_back(static_cast<std::uint16_t>(i * 16));
  const Image image =
      converted("a.jp2", encode_image("jpeg2000", 64, 64, 1, samples, OIIO::TypeDesc::UINT16));
  EXPECT_EQ(image.bits_per_channel, 16);
  EXPECT_NEAR(decode_float(image).data[1000], 16000, 600);
}

/// One of each kind, whole.
std::vector<std::pair<std::string, Bytes>> one_of_each() {
  const std::vector<float> light(16 * 16 * 3, 0.5f);
  return {{"a.bmp", in_format("bmp", 16, 16, 3)},
          {"a.tga", in_format("targa", 16, 16, 3)},
          {"a.gif", in_format("gif", 16, 16, 3)},
          {"a.dds", dds_of(16, 16, "", Bytes(16 * 16 * 4, 77))},
          {"a.jp2", in_format("jpeg2000", 64, 64, 3)},
          {"a.hdr", encode_image("hdr", 16, 16, 3, light, OIIO::TypeDesc::FLOAT)}};
}

TEST(OtherPictures, CutFilesAreRefusedOrRead) {
  for (const auto& [name, whole] : one_of_each()) {
    EXPECT_EQ(error_of([&, n = name, w = whole] { converted(n, w); }), "") << name;
    for (std::size_t bytes = 0; bytes < whole.size(); bytes += 1 + whole.size() / 97) {
      const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(bytes));
      const std::string error = error_of([&, n = name] { converted(n, cut); });
      if (bytes < whole.size() / 4) {
        EXPECT_NE(error, "") << name << " " << bytes;
      }
    }
  }
}

TEST(OtherPictures, SizesThatTheBytesCannotHoldAreRefused) {
  const auto claim = [](Bytes bytes, std::size_t at, const Bytes& size) {
    std::copy(size.begin(), size.end(), bytes.begin() + static_cast<std::ptrdiff_t>(at));
    return bytes;
  };
  const auto files = one_of_each();
  const auto refused = [](const std::string& name, const Bytes& bytes) {
    const std::string error = error_of([&] { converted(name, bytes); });
    EXPECT_NE(error.find("image header"), std::string::npos) << name << ": " << error;
  };
  for (const Bytes& side : {Bytes{0, 0, 0, 0}, Bytes{0xff, 0xff, 0xff, 0x7f}, Bytes{0, 0xf0, 0, 0}}) {
    refused("a.bmp", claim(claim(files[0].second, 18, side), 22, side));
    refused("a.dds", claim(claim(files[3].second, 12, side), 16, side));
  }
  for (const Bytes& side : {Bytes{0, 0}, Bytes{0xff, 0xf0}}) {
    refused("a.tga", claim(claim(files[1].second, 12, side), 14, side));
    refused("a.gif", claim(claim(files[2].second, 6, side), 8, side));
  }
  Bytes jp2 = files[4].second;
  const Bytes marker{0xff, 0x4f, 0xff, 0x51};
  const auto at = static_cast<std::size_t>(std::search(jp2.begin(), jp2.end(), marker.begin(), marker.end()) -
                                           jp2.begin());
  refused("a.jp2", claim(jp2, at + 8, {0, 1, 0, 0}));                                 // wider
  refused("a.jp2", claim(jp2, at + 8, {0x7f, 0xff, 0xff, 0xff}));                     // far wider
  refused("a.jp2", claim(jp2, at + 24, {0, 0, 0, 0}));                                // tiles of no width
  refused("a.jp2", claim(claim(jp2, at + 24, {0, 0, 0, 1}), at + 28, {0, 0, 0, 1}));  // a tile for each texel
  refused("a.jp2", claim(jp2, at + 40, {0xff, 0xff}));                                // channels
  const auto hdr = [](const char* line) {
    const std::string text = std::string("#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n") + line + "\n";
    return Bytes(text.begin(), text.end());
  };
  for (const char* line :
       {"-Y 60000 +X 60000", "+X 16 -Y 16", "-Y 0 +X 0", "", "-Y 99999999999 +X 99999999999"})
    refused("a.hdr", hdr(line));
}

}  // namespace texmesh::other_pictures_test
