#include "stages/image/decode_jpeg.h"

#include <gtest/gtest.h>

#include "stages/image/image_metadata.h"
#include "tests/stages/image/image_files.h"

namespace texmesh {
namespace {

using namespace testing;  // NOLINT: fixtures

TEST(DecodeJpeg, JpegIsCloseAndRowsAreTopFirst) {
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

TEST(DecodeJpeg, CmykJpegBecomesRgb) {
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

}  // namespace
}  // namespace texmesh
