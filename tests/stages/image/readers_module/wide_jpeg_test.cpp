#include "stages/image/decode_tiff_exr.h"

#include <gtest/gtest.h>

#include "tests/stages/image/image_files.h"
#include "tests/support/wide_jpeg.h"

namespace texmesh::wide_jpeg_test {

using namespace testing;  // NOLINT: fixtures

constexpr unsigned kWidth = 40, kHeight = 24;

std::vector<std::uint16_t> ramps(unsigned channels, unsigned bits) {
  std::vector<std::uint16_t> out;
  const unsigned most = (1u << bits) - 1;
  for (unsigned y = 0; y < kHeight; ++y)
    for (unsigned x = 0; x < kWidth; ++x)
      for (unsigned c = 0; c < channels; ++c)
        out.push_back(static_cast<std::uint16_t>(c == 0   ? most * x / (kWidth - 1)
                                                 : c == 1 ? most * y / (kHeight - 1)
                                                          : most / 3));
  return out;
}

TEST(WideJpeg, TwelveAndSixteenBitsBecomeEight) {
  for (const unsigned bits : {12u, 16u})
    for (const unsigned channels : {1u, 3u}) {
      SCOPED_TRACE(std::to_string(bits) + " bits, " + std::to_string(channels) + " channels");
      const std::vector<std::uint16_t> samples = ramps(channels, bits);
      const Image image = probe(wide_jpeg(kWidth, kHeight, samples, bits));
      EXPECT_EQ(image.format, ImageFormat::kJpeg);
      EXPECT_EQ(image.width_px, kWidth);
      EXPECT_EQ(image.height_px, kHeight);
      EXPECT_EQ(image.channels, channels);
      EXPECT_EQ(image.bits_per_channel, 16);
      Bytes want;
      for (const std::uint16_t s : samples)
        want.push_back(static_cast<std::uint8_t>((s * 255u + (1u << (bits - 1))) / ((1u << bits) - 1)));
      EXPECT_LE(largest_difference(decode_image(image).data, want), bits == 12 ? 3 : 1);
    }
}

TEST(WideJpeg, MeasuredDataKeepTheirBits) {
  const std::vector<std::uint16_t> samples = ramps(1, 16);
  const FloatPixels pixels = decode_float(probe(wide_jpeg(kWidth, kHeight, samples, 16)));
  ASSERT_EQ(pixels.data.size(), samples.size());
  for (std::size_t i = 0; i < samples.size(); ++i) ASSERT_EQ(pixels.data[i], samples[i]) << i;
}

TEST(WideJpeg, EightBitsAreNotWide) {
  EXPECT_FALSE(read_wide_jpeg_header("x.jpg", jpeg_bytes(16, 16, 3)));
  EXPECT_FALSE(read_wide_jpeg_header("x.jpg", Bytes{}));
}

TEST(WideJpeg, EveryTruncationIsRefused) {
  for (const unsigned bits : {12u, 16u}) {
    const Bytes whole = wide_jpeg(kWidth, kHeight, ramps(3, bits), bits);
    // Two bytes of the end are a padding byte and half of the marker that ends the file.
    for (std::size_t size = 0; size + 3 < whole.size(); ++size) {
      const std::string error = error_of([&] {
        decode_image(probe(Bytes(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size))));
      });
      ASSERT_FALSE(error.empty()) << bits << " bits, cut to " << size << " of " << whole.size();
    }
  }
}

TEST(WideJpeg, EveryChangedByteIsRefusedOrDecodes) {
  for (const unsigned bits : {12u, 16u}) {
    const Bytes whole = wide_jpeg(kWidth, kHeight, ramps(3, bits), bits);
    for (std::size_t at = 0; at < whole.size(); ++at) {
      Bytes changed = whole;
      changed[at] ^= static_cast<std::uint8_t>(1u << at % 8);
      try {
        const Image image = probe_image("x.jpg", changed, {4096, 1 << 20});
        const Pixels pixels = decode_image(image);
        ASSERT_EQ(pixels.data.size(), std::size_t{image.width_px} * image.height_px * image.channels);
      } catch (const InputError&) {
      }
    }
  }
}

/// With another byte in the body of the frame header, after its marker and length.
Bytes with_frame_byte(Bytes jpeg, std::size_t at, std::uint8_t value) {
  for (std::size_t i = 0; i + 9 < jpeg.size(); ++i)
    if (jpeg[i] == 0xff && (jpeg[i + 1] == 0xc0 || jpeg[i + 1] == 0xc1)) {
      jpeg[i + 4 + at] = value;
      break;
    }
  return jpeg;
}

TEST(WideJpeg, ASizeThatItsBytesCannotHoldIsRefusedBeforeMemoryIsTaken) {
  const Bytes jpeg = with_frame_byte(wide_jpeg(kWidth, kHeight, ramps(1, 12), 12), 1, 0xff);  // of the height
  const std::string error = error_of([&] { decode_image(probe(jpeg)); });
  EXPECT_NE(error.find("a size that its"), std::string::npos) << error;
}

TEST(WideJpeg, FourComponentsAreRefused) {
  const Bytes jpeg = with_frame_byte(wide_jpeg(kWidth, kHeight, ramps(3, 12), 12), 5, 4);
  const std::string error = error_of([&] { probe(jpeg); });
  EXPECT_NE(error.find("1 or 3 components of 12 bits"), std::string::npos) << error;
}

}  // namespace texmesh::wide_jpeg_test
