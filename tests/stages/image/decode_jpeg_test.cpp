#include "stages/image/decode_jpeg.h"

#include <gtest/gtest.h>

#include <cstring>

#include "stages/image/image_metadata.h"
#include "tests/stages/image/image_files.h"
#include "tests/stages/ladder/source_scenes.h"

namespace texmesh::decode_jpeg_test {

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

Bytes cut(const Bytes& jpeg, double part) {
  return {jpeg.begin(), jpeg.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(jpeg.size()))};
}

TEST(DecodeJpeg, ADamagedFileIsShownAsViewersShowItWhereThatIsAccepted) {
  const Kind kinds[] = {{"baseline"}, {"progressive", 3, 1, 1, true}, {"grey", 1}};
  for (const Kind& kind : kinds) {
    SCOPED_TRACE(kind.name);
    const Bytes whole = make_jpeg(kind, 64, 64);
    const Pixels sound = decode_image(probe(whole));
    Image image = probe(cut(whole, 0.9));
    EXPECT_NE(error_of([&] { decode_image(image); }), "");
    image.accept_damage = true;
    std::string damage;
    const Pixels shown = decode_image(image, FloatEncoding::kAsIs, &damage);
    EXPECT_NE(damage.find(" of 64: "), std::string::npos) << damage;
    ASSERT_EQ(shown.data.size(), sound.data.size());
    EXPECT_NE(shown.data, sound.data);
    if (kind.progressive) continue;
    const std::size_t first_rows_bytes = 24 * std::size_t{sound.width_px} * sound.channels;
    EXPECT_EQ(std::memcmp(shown.data.data(), sound.data.data(), first_rows_bytes), 0);
  }
}

TEST(DecodeJpeg, AFileWithoutMostOfItsRowsIsRefused) {
  for (const bool progressive : {false, true}) {
    const Bytes whole = make_jpeg({"", 3, 1, 1, progressive}, 128, 128);
    for (const double part : {0.01, 0.02, progressive ? 0.02 : 0.4}) {
      try {
        Image image = probe(cut(whole, part));
        image.accept_damage = true;
        std::string damage;
        decode_image(image, FloatEncoding::kAsIs, &damage);
        ADD_FAILURE() << part << " of it is enough: " << damage;
      } catch (const InputError&) {
      }
    }
  }
}

TEST(DecodeJpeg, ASoundFileHasNoDamage) {
  Image image = probe(make_jpeg({""}, 64, 64));
  image.accept_damage = true;
  std::string damage = "of another one";
  decode_image(image, FloatEncoding::kAsIs, &damage);
  EXPECT_EQ(damage, "");
}

}  // namespace texmesh::decode_jpeg_test
