// Sizes and files of single images, and the difference between pictures.
#include <gtest/gtest.h>

#include <cmath>

#include "format/base/errors.h"
#include "stages/image/decode_image.h"
#include "stages/image/resize.h"
#include "stages/measure/flip.h"
#include "tools/extract/glb/texture_source.h"

namespace texmesh::standalone_glb_test {

Pixels pattern(std::uint32_t width, std::uint32_t height, std::uint32_t channels) {
  Pixels p{width, height, channels, {}};
  for (std::uint32_t y = 0; y < height; ++y)
    for (std::uint32_t x = 0; x < width; ++x)
      for (std::uint32_t c = 0; c < channels; ++c)
        p.data.push_back(
            static_cast<std::uint8_t>(c == 3 ? 255 - x % 9 : 60 + (3 * x + 2 * y + 40 * c) % 140));
  return p;
}

Pixels flat(std::uint32_t width, std::uint32_t height, std::uint8_t value) {
  return {width, height, 3, std::vector<std::uint8_t>(std::size_t{3} * width * height, value)};
}

double mean_error(const Pixels& a, const Pixels& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.data.size(); ++i) sum += std::abs(a.data[i] - b.data[i]);
  return sum / static_cast<double>(a.data.size());
}

TEST(Reduced, FlatImagesStayFlatAtEverySize) {
  for (std::uint32_t width : {1u, 2u, 7u, 12u, 13u, 30u})
    for (const Averaging kind : {Averaging::kLight, Averaging::kNumbers})
      for (const float sharpening : {0.f, 0.125f}) {
        const Pixels out = reduced(flat(30, 17, 99), 30, 17, width, 5, kind, sharpening);
        EXPECT_EQ(out.data, flat(width, 5, 99).data) << width;
      }
}

TEST(Reduced, AveragesLightOverExactAreas) {
  // Half black, half white is a fifth brighter than 128 as light: 188. Three texels to two cut one in half.
  const Pixels two{2, 1, 1, {0, 255}}, three{3, 1, 1, {30, 60, 90}};
  EXPECT_EQ(reduced(two, 2, 1, 1, 1, Averaging::kLight).data, std::vector<std::uint8_t>{188});
  EXPECT_EQ(reduced(two, 2, 1, 1, 1, Averaging::kNumbers).data, std::vector<std::uint8_t>{128});
  EXPECT_EQ(reduced(three, 3, 1, 2, 1, Averaging::kNumbers).data, (std::vector<std::uint8_t>{40, 80}));
}

TEST(Reduced, NormalsStayUnitVectors) {
  Pixels normals{2, 1, 3, {255, 128, 128, 128, 255, 128}};
  const Pixels out = reduced(normals, 2, 1, 1, 1, Averaging::kNormals);
  EXPECT_NEAR(out.data[0], 218, 1);  // (1, 1, 0) / sqrt 2
  EXPECT_NEAR(out.data[1], 218, 1);
}

TEST(Reduced, SharpeningKeepsTheMeanAndSteepensEdges) {
  Pixels edge{8, 1, 1, {100, 100, 100, 100, 150, 150, 150, 150}};
  const Pixels out = reduced(edge, 8, 1, 4, 1, Averaging::kNumbers, 0.1f);
  EXPECT_EQ(out.data, (std::vector<std::uint8_t>{100, 95, 155, 150}));
}

TEST(Reduced, RefusesLargerAndEmptySizes) {
  EXPECT_THROW(reduced(pattern(4, 4, 3), 4, 4, 5, 4, Averaging::kLight), StageError);
  EXPECT_THROW(reduced(pattern(4, 4, 3), 4, 4, 0, 4, Averaging::kLight), StageError);
  EXPECT_THROW(reduced(pattern(4, 4, 3), 5, 4, 2, 2, Averaging::kLight), StageError);
}

TEST(EncodeImage, EveryFormatDecodesToNearlyTheSame) {
  for (const std::uint32_t channels : {1u, 3u, 4u})
    for (const FileImage format : {FileImage::kJpeg, FileImage::kWebp, FileImage::kPng})
      for (const bool data : {false, true}) {
        const Pixels pixels = pattern(37, 21, channels);
        if (format == FileImage::kJpeg && channels == 4) {
          EXPECT_THROW(encode_image(pixels, {format, 90, data, false}), StageError);
          continue;
        }
        const auto file = encode_image(pixels, {format, 95, data, false});
        EXPECT_EQ(file, encode_image(pixels, {format, 95, data, false}));
        Pixels back = decode_image(probe_image("x", file, {}));
        if (back.channels == 3 && channels == 1) {
          Pixels grey{back.width_px, back.height_px, 1, {}};
          for (std::size_t i = 0; i < back.data.size(); i += 3) grey.data.push_back(back.data[i]);
          back = grey;
        }
        ASSERT_EQ(back.data.size(), pixels.data.size()) << static_cast<int>(format) << " " << channels;
        EXPECT_LT(mean_error(back, pixels), format == FileImage::kPng ? 1e-9 : 9) << static_cast<int>(format);
      }
}

TEST(EncodeImage, LowerQualityIsSmallerAndWrongPixelsAreRefused) {
  const Pixels pixels = pattern(64, 64, 3);
  for (const FileImage format : {FileImage::kJpeg, FileImage::kWebp})
    EXPECT_LT(encode_image(pixels, {format, 10}).size(), encode_image(pixels, {format, 90}).size());
  EXPECT_LT(encode_image(pixels, {FileImage::kJpeg, 90}).size(),
            encode_image(pixels, {FileImage::kJpeg, 91.5}).size());
  EXPECT_LT(encode_image(pixels, {FileImage::kJpeg, 91.5}).size(),
            encode_image(pixels, {FileImage::kJpeg, 93}).size());
  Pixels torn = pixels;
  torn.data.pop_back();
  EXPECT_THROW(encode_image(torn, {}), StageError);
  EXPECT_THROW(encode_image({}, {}), StageError);
}

Picture picture(std::uint32_t side, float inside, float shift) {
  Picture p;
  p.side_px = side;
  for (std::uint32_t y = 0; y < side; ++y)
    for (std::uint32_t x = 0; x < side; ++x) {
      const bool object = x > side / 4 && x < 3 * side / 4;
      const float stripe = object && (x / 4) % 2 ? shift : 0.f;
      p.linear.push_back(object ? Vec3f{inside + stripe, inside, inside} : Vec3f{0.2f, 0.2f, 0.2f});
      p.covered.push_back(object);
    }
  return p;
}

TEST(Flip, IsNothingForEqualPicturesAndGrowsWithTheDifference) {
  const FlipPicture reference = prepare_flip(picture(48, 0.5f, 0));
  EXPECT_EQ(flip_of(reference, reference), 0);
  double before = 0;
  for (const float inside : {0.48f, 0.45f, 0.4f, 0.3f, 0.f}) {
    const double found = flip_of(reference, prepare_flip(picture(48, inside, 0)));
    EXPECT_GT(found, before);
    EXPECT_LE(found, 1);
    before = found;
  }
  // Black against white is the largest difference there is, by the published remapping.
  Picture black = picture(48, 0, 0), white = picture(48, 1, 0);
  for (Vec3f& c : black.linear) c = {0, 0, 0};
  for (Vec3f& c : white.linear) c = {1, 1, 1};
  EXPECT_GT(flip_of(prepare_flip(white), prepare_flip(black)), 0.9);
}

TEST(Flip, EmptyBackgroundAroundDoesNotMatter) {
  const auto in_corner = [](std::uint32_t side, float value) {
    Picture p;
    p.side_px = side;
    for (std::uint32_t y = 0; y < side; ++y)
      for (std::uint32_t x = 0; x < side; ++x) {
        const bool object = x >= 40 && x < 60 && y >= 30 && y < 66;
        p.linear.push_back(object ? Vec3f{value, (x / 3) % 2 ? 0.5f : 0.2f, value} : Vec3f{0.2f, 0.2f, 0.2f});
        p.covered.push_back(object);
      }
    return p;
  };
  const auto flip = [&](std::uint32_t side) {
    return flip_of(prepare_flip(in_corner(side, 0.5f)), prepare_flip(in_corner(side, 0.4f)));
  };
  EXPECT_GT(flip(100), 0.01);
  EXPECT_NEAR(flip(100), flip(240), 1e-6);
}

TEST(Flip, SeesTexture) {
  const FlipPicture reference = prepare_flip(picture(48, 0.4f, 0.2f));
  EXPECT_GT(flip_of(reference, prepare_flip(picture(48, 0.4f, 0))),
            flip_of(reference, prepare_flip(picture(48, 0.4f, 0.15f))));
}

}  // namespace texmesh::standalone_glb_test
