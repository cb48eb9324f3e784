#include "stages/image/avif.h"

#include <avif/avif.h>
#include <gtest/gtest.h>

#include <functional>

#include "stages/image/readers_module/other_pictures.h"
#include "tests/support/images.h"

namespace texmesh::avif_test {

Pixels picture(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
  return {
      width, height, channels,
      testing::test_picture(static_cast<int>(width), static_cast<int>(height), static_cast<int>(channels))};
}

Pixels smooth_picture(std::uint32_t channels) {
  Pixels out{48, 40, channels, {}};
  for (std::uint32_t y = 0; y < 40; ++y)
    for (std::uint32_t x = 0; x < 48; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        out.data.push_back(static_cast<std::uint8_t>(20 + 2 * x + (c + 1) * y / 2));
  return out;
}

/// By libavif alone: kinds of files that texmesh does not write.
Bytes foreign_avif(std::uint32_t depth, int pictures, const std::function<void(avifImage&)>& change) {
  avifImage* image = avifImageCreate(16, 12, depth, AVIF_PIXEL_FORMAT_YUV420);
  avifImageAllocatePlanes(image, AVIF_PLANES_YUV);
  for (int plane = 0; plane < 3; ++plane)
    std::fill_n(image->yuvPlanes[plane], image->yuvRowBytes[plane] * (plane == 0 ? 12u : 6u),
                std::uint8_t{1});
  change(*image);
  avifEncoder* encoder = avifEncoderCreate();
  encoder->speed = 10;
  for (int i = 0; i < pictures; ++i)
    EXPECT_EQ(avifEncoderAddImage(encoder, image, 1,
                                  pictures == 1 ? AVIF_ADD_IMAGE_FLAG_SINGLE : AVIF_ADD_IMAGE_FLAG_NONE),
              AVIF_RESULT_OK);
  avifRWData out = AVIF_DATA_EMPTY;
  EXPECT_EQ(avifEncoderFinish(encoder, &out), AVIF_RESULT_OK);
  Bytes bytes(out.data, out.data + out.size);
  avifRWDataFree(&out), avifEncoderDestroy(encoder), avifImageDestroy(image);
  return bytes;
}

TEST(Avif, FilesHaveThePictureBack) {
  for (const std::uint32_t channels : {1u, 3u, 4u})
    for (const bool data : {false, true}) {
      const Pixels in = smooth_picture(channels);
      const Bytes file = encode_avif(in, {.quality = 95, .data = data});
      ASSERT_TRUE(is_avif(file));
      EXPECT_FALSE(sniff_image_format(file).has_value());
      const AvifPicture out = decode_avif("x", file, {});
      EXPECT_EQ(out.width_px, in.width_px);
      EXPECT_EQ(out.height_px, in.height_px);
      ASSERT_EQ(out.channels, channels);
      const Bytes& samples = std::get<Bytes>(out.samples);
      ASSERT_EQ(samples.size(), in.data.size());
      for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_NEAR(samples[i], in.data[i], 6) << i;
    }
}

TEST(Avif, BytesGrowWithQualityAndAreTheSameAgain) {
  const Pixels in = picture(96, 64, 3);
  std::size_t before = 0;
  for (const double quality : {-5.0, 5.0, 30.0, 75.0, 97.0, 200.0}) {
    const Bytes file = encode_avif(in, {.quality = quality});
    EXPECT_GE(file.size(), before) << quality;
    before = file.size();
    EXPECT_EQ(encode_avif(in, {.quality = quality}), file);
  }
  EXPECT_TRUE(is_avif(encode_avif(picture(1, 1, 3), {})));
  EXPECT_TRUE(is_avif(encode_avif(picture(3, 1, 1), {.quick = true})));
}

TEST(Avif, LimitsCountBeforePixels) {
  const Bytes file = encode_avif(picture(96, 64, 3), {});
  EXPECT_THROW(decode_avif("x", file, {.max_side_px = 95}), InputError);
  EXPECT_THROW(decode_avif("x", file, {.max_pixels = 96 * 64 - 1}), InputError);
  try {
    decode_avif("x", file, {.max_side_px = 95});
  } catch (const InputError& e) {
    EXPECT_EQ(e.expected(), "sides up to 95 px");
    EXPECT_EQ(e.found(), "96 x 64") << "not a file that cannot be parsed";
  }
  EXPECT_EQ(decode_avif("x", file, {.max_side_px = 96, .max_pixels = 96 * 64}).width_px, 96u);
}

TEST(Avif, EveryTruncationIsRefused) {
  const Bytes file = encode_avif(picture(24, 16, 4), {});
  for (std::size_t n = 0; n < file.size(); ++n)
    EXPECT_THROW(decode_avif("x", ByteSpan(file).first(n), {}), InputError) << n;
}

TEST(Avif, FlippedBytesAreRefusedOrChangeTexels) {
  const Bytes file = encode_avif(picture(24, 16, 4), {});
  for (std::size_t i = 0; i < file.size(); ++i)
    for (const std::uint8_t flip : {0x01, 0x80, 0xff}) {
      Bytes damaged = file;
      damaged[i] ^= flip;
      try {
        const AvifPicture out = decode_avif("x", damaged, {.max_side_px = 4096});
        std::visit(
            [&](const auto& samples) {
              EXPECT_EQ(samples.size(), std::size_t{out.width_px} * out.height_px * out.channels);
            },
            out.samples);
      } catch (const InputError& e) {
        EXPECT_NE(std::string(e.what()).find("x: "), std::string::npos);
      }
    }
}

TEST(Avif, SamplesOfTenBitsBecomeSixteen) {
  const Bytes file = foreign_avif(10, 1, [](avifImage& image) {
    for (int plane = 0; plane < 3; ++plane)
      for (std::uint32_t i = 0; i < image.yuvRowBytes[plane] * (plane == 0 ? 12u : 6u); i += 2)
        reinterpret_cast<std::uint16_t*>(image.yuvPlanes[plane])[i / 2] = 512;
  });
  const AvifPicture out = decode_avif("x", file, {});
  ASSERT_EQ(out.channels, 3u);
  EXPECT_NEAR(std::get<std::vector<std::uint16_t>>(out.samples)[0], 512 * 65535 / 1023, 200);
  const ConvertedPicture converted = convert_other_picture("x.avif", OtherPicture::kAvif, file, {});
  EXPECT_EQ(sniff_image_format(converted.bytes), ImageFormat::kTiff);
}

TEST(Avif, SequencesAndProfilesAreTold) {
  const auto none = [](avifImage&) {};
  EXPECT_FALSE(decode_avif("x", foreign_avif(8, 1, none), {}).more_pictures);
  EXPECT_TRUE(decode_avif("x", foreign_avif(8, 2, none), {}).more_pictures);
  const Bytes profiled = foreign_avif(8, 1, [](avifImage& image) {
    const std::uint8_t icc[] = {1, 2, 3, 4};
    avifImageSetProfileICC(&image, icc, sizeof icc);
  });
  EXPECT_TRUE(decode_avif("x", profiled, {}).profile);
}

TEST(Avif, PicturesThatAreToBeTurnedAreRefused) {
  const Bytes turned = foreign_avif(8, 1, [](avifImage& image) {
    image.transformFlags = AVIF_TRANSFORM_IROT;
    image.irot.angle = 1;
  });
  EXPECT_THROW(decode_avif("x", turned, {}), InputError);
}

TEST(Avif, BecomesAPngWhenItIsImported) {
  const Bytes file = encode_avif(smooth_picture(4), {.quality = 90});
  ASSERT_EQ(sniff_other_picture("x.avif", file), OtherPicture::kAvif);
  const ConvertedPicture out = convert_other_picture("x.avif", OtherPicture::kAvif, file, {});
  const Pixels png = decode_image(probe_image("x", out.bytes, {}));
  EXPECT_EQ(png.data, std::get<Bytes>(decode_avif("x", file, {}).samples));
  EXPECT_FALSE(sniff_other_picture("x.avif", Bytes{0, 0, 0, 28, 'f', 't', 'y', 'p', 'h', 'e', 'i', 'c'}));
}

}  // namespace texmesh::avif_test
