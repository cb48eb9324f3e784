#include "stages/image/decode_tiff_exr.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stages/image/image_metadata.h"
#include "tests/stages/image/hostile_pictures.h"
#include "tests/stages/image/image_files.h"
#include "tests/stages/image/tiff_files.h"

namespace texmesh::decode_tiff_exr_test {

using namespace testing;  // NOLINT: fixtures

TEST(DecodeTiffExr, FloatsKeepTheirRangeAndColoursAreEncoded) {
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

TEST(DecodeTiffExr, HalfFloatsAndAlphaOfExr) {
  const std::vector<float> samples{0.5f, 0.25f, 0.125f, 0.5f};
  const Image image = probe(encode_image("openexr", 1, 1, 4, samples, OIIO::TypeDesc::FLOAT));
  const Pixels srgb = decode_image(image, FloatEncoding::kSrgb);
  EXPECT_EQ(srgb.data[3], 128) << "alpha is never encoded";
}

TEST(DecodeTiffExr, PalettesAndFewBitsExpand) {
  Bytes samples(64 * 64, 0);
  for (std::size_t i = 0; i < samples.size(); ++i) samples[i] = i % 3 ? 255 : 0;
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:BitsPerSample", 1);
  const Image image = probe(encode_image("tiff", 64, 64, 1, samples, OIIO::TypeDesc::UINT8, attributes));
  EXPECT_EQ(decode_image(image).data, samples);
}

TEST(DecodeTiffExr, TiffOfOtherColoursIsConvertedOrRefused) {
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

TEST(DecodeTiffExr, DepthOfAnExrIsNoAlpha) {
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

TEST(DecodeTiffExr, PrimariesOfAnExrAreSeen) {
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

TEST(DecodeTiffExr, WhatLibrariesTookTooMuchForIsRefusedFirst) {
  const auto refusal = [](const Bytes& file) { return error_of([&] { decode_image(probe(file)); }); };
  const std::vector<Bytes> exrs = hostile_exrs();
  for (std::size_t i = 0; i + 1 < exrs.size(); ++i)
    EXPECT_NE(refusal(exrs[i]).find("image header"), std::string::npos) << refusal(exrs[i]);
  EXPECT_NE(refusal(exrs.back()).find("a whole EXR"), std::string::npos) << refusal(exrs.back());
  for (const Bytes& file : {tiff_of_large_tile(), tiff_of_long_strip()})
    EXPECT_NE(refusal(file).find("a size that its"), std::string::npos) << refusal(file);
}

}  // namespace texmesh::decode_tiff_exr_test
