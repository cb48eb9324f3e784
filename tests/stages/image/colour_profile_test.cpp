#include "stages/image/image_metadata.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <cstring>
#include <set>

#include "format/base/bytes.h"
#include "format/base/errors.h"
#include "stages/image/decode_image.h"
#include "tests/support/images.h"

namespace texmesh::colour_profile_test {

void put16(Bytes& out, std::uint32_t x) {
  out.push_back(static_cast<std::uint8_t>(x >> 8));
  out.push_back(static_cast<std::uint8_t>(x));
}
void put32(Bytes& out, std::uint32_t x) { put16(out, x >> 16), put16(out, x & 0xffff); }
void put_text(Bytes& out, const char* text) { out.insert(out.end(), text, text + 4); }
void put_fixed(Bytes& out, double x) {
  put32(out, static_cast<std::uint32_t>(static_cast<std::int32_t>(std::lround(x * 65536))));
}

Bytes curve_of_gamma(double gamma) {
  Bytes out;
  put_text(out, "curv"), put32(out, 0), put32(out, 1), put16(out, static_cast<std::uint32_t>(gamma * 256));
  return out;
}
Bytes curve_of_points(const std::vector<std::uint16_t>& points) {
  Bytes out;
  put_text(out, "curv"), put32(out, 0), put32(out, static_cast<std::uint32_t>(points.size()));
  for (std::uint16_t p : points) put16(out, p);
  return out;
}
Bytes parametric(std::uint32_t form, const std::vector<double>& parameters) {
  Bytes out;
  put_text(out, "para"), put32(out, 0), put16(out, form), put16(out, 0);
  for (double p : parameters) put_fixed(out, p);
  return out;
}
Bytes xyz(double x, double y, double z) {
  Bytes out;
  put_text(out, "XYZ "), put32(out, 0), put_fixed(out, x), put_fixed(out, y), put_fixed(out, z);
  return out;
}

using Tags = std::vector<std::pair<const char*, Bytes>>;

Bytes make_icc(const char* space, const Tags& tags) {
  Bytes out(128, 0), data;
  std::memcpy(out.data() + 16, space, 4);
  std::memcpy(out.data() + 36, "acsp", 4);
  put32(out, static_cast<std::uint32_t>(tags.size()));
  for (const auto& [name, bytes] : tags) {
    put_text(out, name);
    put32(out, static_cast<std::uint32_t>(132 + 12 * tags.size() + data.size()));
    put32(out, static_cast<std::uint32_t>(bytes.size()));
    data.insert(data.end(), bytes.begin(), bytes.end());
  }
  out.insert(out.end(), data.begin(), data.end());
  return out;
}

Bytes rgb_icc(const Bytes& curve, bool wide = false) {
  Tags tags{{"rTRC", curve}, {"gTRC", curve}, {"bTRC", curve}};
  if (wide) {  // Adobe RGB (1998)
    tags.insert(tags.end(), {{"rXYZ", xyz(0.60974, 0.31111, 0.01947)},
                             {"gXYZ", xyz(0.20528, 0.62567, 0.06087)},
                             {"bXYZ", xyz(0.14919, 0.06322, 0.74457)}});
  } else {
    tags.insert(tags.end(), {{"rXYZ", xyz(0.43607, 0.22249, 0.01392)},
                             {"gXYZ", xyz(0.38515, 0.71687, 0.09708)},
                             {"bXYZ", xyz(0.14307, 0.06061, 0.71410)}});
  }
  return make_icc("RGB ", tags);
}
Bytes srgb_icc() { return rgb_icc(parametric(3, {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045})); }
Bytes adobe_icc() { return rgb_icc(curve_of_gamma(563 / 256.0), true); }

/// The image's first texels after conversion.
Bytes converted(const Bytes& icc, std::uint32_t channels, const Bytes& samples) {
  Pixels p{static_cast<std::uint32_t>(samples.size() / channels), 1, channels, samples};
  convert_to_srgb(read_icc_profile("image", icc, channels), p);
  return p.data;
}

TEST(ColourProfile, SrgbInItsThreeWritingsIsSrgb) {
  std::vector<std::uint16_t> points;
  for (int i = 0; i < 1024; ++i) {
    const double x = i / 1023.0;
    points.push_back(static_cast<std::uint16_t>(
        std::lround(65535 * (x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4)))));
  }
  EXPECT_TRUE(is_srgb(read_icc_profile("p", srgb_icc(), 3)));
  EXPECT_TRUE(is_srgb(read_icc_profile("p", rgb_icc(curve_of_points(points)), 4)));
  EXPECT_FALSE(is_srgb(read_icc_profile("p", rgb_icc(curve_of_gamma(1.8)), 3)));
  EXPECT_FALSE(is_srgb(read_icc_profile("p", adobe_icc(), 3)));
  EXPECT_TRUE(is_srgb(read_icc_profile(
      "p",
      make_icc("GRAY", {{"kTRC", parametric(4, {2.4, 1 / 1.055, 0.055 / 1.055, 1 / 12.92, 0.04045, 0, 0})}}),
      1)));
}

TEST(ColourProfile, KnownColours) {
  // Adobe RGB to sRGB by any colour management: mid grey nearly stays, its green lies outside, (100, 150,
  // 200) becomes (61, 150, 202).
  const Bytes out = converted(adobe_icc(), 3, {128, 128, 128, 0, 255, 0, 100, 150, 200});
  const int want[] = {128, 128, 128, 0, 255, 0, 66, 150, 202};
  for (std::size_t i = 0; i < 9; ++i) EXPECT_NEAR(out[i], want[i], 2) << i;
  // Linear light: 0.5 is code 188.
  EXPECT_EQ(converted(rgb_icc(curve_of_points({})), 3, {128, 0, 255})[0], 188);
  // Alpha stays, grey has one curve.
  EXPECT_EQ(converted(make_icc("GRAY", {{"kTRC", curve_of_points({})}}), 2, {128, 77}), (Bytes{188, 77}));
  // Forms 1 and 2: (x - 0.25) / 0.75 squared from 0.25 on, nothing or 0.5 below.
  EXPECT_EQ(converted(make_icc("GRAY", {{"kTRC", parametric(1, {2, 4 / 3.0, -1 / 3.0})}}), 1, {20, 255}),
            (Bytes{0, 255}));
  EXPECT_EQ(converted(make_icc("GRAY", {{"kTRC", parametric(2, {2, 1, -0.25, 0.5})}}), 1, {20})[0], 188);
}

TEST(ColourProfile, GammaIsThePowerItSays) {
  Pixels p{1, 1, 3, {128, 128, 128}};
  convert_to_srgb(gamma_profile(1, 3), p);
  EXPECT_EQ(p.data, (Bytes{188, 188, 188}));
}

TEST(ColourProfile, OtherKindsAreRefusedWithAWord) {
  const auto error = [](const Bytes& icc, std::uint32_t channels) -> std::string {
    try {
      read_icc_profile("scan.jpg", icc, channels);
    } catch (const InputError& e) {
      return e.what();
    }
    return "";
  };
  EXPECT_NE(error(make_icc("RGB ", {{"A2B0", Bytes(40)}}), 3).find("lookup tables"), std::string::npos);
  EXPECT_NE(error(make_icc("RGB ", {{"A2B0", Bytes(40)}}), 3).find("convert the image to sRGB"),
            std::string::npos);
  EXPECT_NE(error(make_icc("CMYK", {{"A2B0", Bytes(40)}}), 3).find("CMYK"), std::string::npos);
  EXPECT_NE(error(srgb_icc(), 1).find("grey"), std::string::npos);
  EXPECT_NE(error({1, 2, 3}, 3), "");
  const Bytes whole = adobe_icc();
  for (std::size_t n = 0; n < whole.size(); ++n)
    EXPECT_NE(error({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)}, 3), "") << n;
  for (std::size_t i = 0; i < whole.size(); ++i) {  // whatever happens, no harm
    Bytes flipped = whole;
    flipped[i] ^= 0x81;
    error(flipped, 3);
  }
}

// --- in files
// ---------------------------------------------------------------------------------------------------

Bytes with_jpeg_segment(const Bytes& jpeg, std::uint8_t marker, const Bytes& body) {
  Bytes out{0xff, 0xd8, 0xff, marker};
  put16(out, static_cast<std::uint32_t>(body.size() + 2));
  out.insert(out.end(), body.begin(), body.end());
  out.insert(out.end(), jpeg.begin() + 2, jpeg.end());
  return out;
}

Bytes jpeg_with_icc(Bytes jpeg, const Bytes& icc) {
  const std::size_t half = icc.size() / 2;  // two segments, the second one first
  for (std::uint8_t k : {std::uint8_t{1}, std::uint8_t{2}}) {
    Bytes body;
    const char* magic = "ICC_PROFILE";
    body.insert(body.end(), magic, magic + 12);
    body.push_back(k), body.push_back(2);
    body.insert(body.end(), icc.begin() + static_cast<std::ptrdiff_t>(k == 1 ? 0 : half),
                k == 1 ? icc.begin() + static_cast<std::ptrdiff_t>(half) : icc.end());
    jpeg = with_jpeg_segment(jpeg, 0xe2, body);
  }
  return jpeg;
}

Bytes png_with_chunk(const Bytes& png, const char* type, const Bytes& data) {
  constexpr std::ptrdiff_t kAfterHeader = 33;
  Bytes out(png.begin(), png.begin() + kAfterHeader), chunk;
  put_text(chunk, type);
  chunk.insert(chunk.end(), data.begin(), data.end());
  put32(out, static_cast<std::uint32_t>(data.size()));
  out.insert(out.end(), chunk.begin(), chunk.end());
  put32(out, static_cast<std::uint32_t>(crc32(0, chunk.data(), static_cast<uInt>(chunk.size()))));
  out.insert(out.end(), png.begin() + kAfterHeader, png.end());
  return out;
}

Bytes iccp(const Bytes& icc) {
  Bytes data{'n', 0, 0};
  uLongf size = compressBound(static_cast<uLong>(icc.size()));
  Bytes packed(size);
  compress(packed.data(), &size, icc.data(), static_cast<uLong>(icc.size()));
  data.insert(data.end(), packed.begin(), packed.begin() + static_cast<std::ptrdiff_t>(size));
  return data;
}

Bytes exif(std::uint32_t orientation) {
  Bytes out{'E', 'x', 'i', 'f', 0, 0, 'M', 'M'};
  put16(out, 42), put32(out, 8), put16(out, 1);
  put16(out, 0x112), put16(out, 3), put32(out, 1), put16(out, orientation), put16(out, 0), put32(out, 0);
  return out;
}

TEST(ImageMetadata, MoreThanOnePictureIsSeen) {
  const auto more = [](ImageFormat format, std::span<const std::uint8_t> bytes) {
    return read_image_metadata(format, bytes).more_pictures;
  };
  Bytes tiff = testing::encode_image("tiff", 8, 8, 3, testing::test_picture(8, 8, 3), OIIO::TypeDesc::UINT8);
  EXPECT_FALSE(more(ImageFormat::kTiff, tiff));
  ASSERT_EQ(tiff[0], 'I');
  const auto at = [&](std::size_t place) {
    return std::size_t{tiff[place]} | std::size_t{tiff[place + 1]} << 8;
  };
  const std::size_t directory = at(4) | at(6) << 16, next = directory + 2 + 12 * at(directory);
  const Bytes page(tiff.begin() + static_cast<std::ptrdiff_t>(directory), tiff.end());
  const std::size_t second = tiff.size();
  for (std::size_t k = 0; k < 4; ++k) tiff[next + k] = static_cast<std::uint8_t>(second >> (8 * k));
  EXPECT_FALSE(more(ImageFormat::kTiff, tiff)) << "there is nothing";
  tiff.insert(tiff.end(), page.begin(), page.end());
  EXPECT_TRUE(more(ImageFormat::kTiff, tiff));
  for (std::size_t n = 0; n < tiff.size(); ++n) more(ImageFormat::kTiff, std::span(tiff).first(n));

  const Bytes png = testing::png_bytes(8, 8, 3);
  EXPECT_FALSE(more(ImageFormat::kPng, png));
  EXPECT_FALSE(more(ImageFormat::kPng, png_with_chunk(png, "acTL", {0, 0, 0, 1, 0, 0, 0, 0})));
  EXPECT_TRUE(more(ImageFormat::kPng, png_with_chunk(png, "acTL", {0, 0, 0, 9, 0, 0, 0, 0})));
  EXPECT_FALSE(more(ImageFormat::kExr, Bytes{0x76, 0x2f, 0x31, 1, 2, 0, 0, 0}));
  EXPECT_TRUE(more(ImageFormat::kExr, Bytes{0x76, 0x2f, 0x31, 1, 2, 0x10, 0, 0}));
}

TEST(ImageMetadata, ProfilesAreFoundInEveryFormat) {
  const Bytes icc = adobe_icc();
  const Bytes jpeg = jpeg_with_icc(testing::jpeg_bytes(8, 8, 3), icc);
  const Bytes png = png_with_chunk(testing::png_bytes(8, 8, 3), "iCCP", iccp(icc));
  OIIO::ImageSpec attributes;
  attributes.attribute("ICCProfile", OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(icc.size())),
                       icc.data());
  const Bytes tiff = testing::encode_image("tiff", 8, 8, 3, testing::test_picture(8, 8, 3),
                                           OIIO::TypeDesc::UINT8, attributes);
  EXPECT_EQ(read_image_metadata(ImageFormat::kJpeg, jpeg).icc_profile, icc);
  EXPECT_EQ(read_image_metadata(ImageFormat::kPng, png).icc_profile, icc);
  EXPECT_EQ(read_image_metadata(ImageFormat::kTiff, tiff).icc_profile, icc);
  EXPECT_TRUE(read_image_metadata(ImageFormat::kJpeg, testing::jpeg_bytes(8, 8, 3)).icc_profile.empty());
  for (const auto& [format, file] :
       {std::pair{ImageFormat::kJpeg, jpeg}, {ImageFormat::kPng, png}, {ImageFormat::kTiff, tiff}})
    for (std::size_t n = 0; n < file.size(); ++n)
      read_image_metadata(format, std::span(file).first(n));  // nothing is read beyond the end
}

TEST(ImageMetadata, OrientationAndGamma) {
  EXPECT_EQ(
      read_image_metadata(ImageFormat::kJpeg, with_jpeg_segment(testing::jpeg_bytes(8, 8, 3), 0xe1, exif(6)))
          .orientation,
      6);
  EXPECT_EQ(
      read_image_metadata(ImageFormat::kJpeg, with_jpeg_segment(testing::jpeg_bytes(8, 8, 3), 0xe1, exif(9)))
          .orientation,
      1);
  Bytes gamma;
  put32(gamma, 100000);
  const Bytes png = testing::png_bytes(8, 8, 3);
  EXPECT_EQ(read_image_metadata(ImageFormat::kPng, png_with_chunk(png, "gAMA", gamma)).gamma, 1.0);
  EXPECT_EQ(
      read_image_metadata(ImageFormat::kPng, png_with_chunk(png_with_chunk(png, "gAMA", gamma), "sRGB", {0}))
          .gamma,
      0.0);
  put32(gamma, 0);
  gamma = {0, 0, 0xb1, 0x8f};  // 45455: what everybody writes
  EXPECT_EQ(read_image_metadata(ImageFormat::kPng, png_with_chunk(png, "gAMA", gamma)).gamma, 0.0);
}

TEST(ImageMetadata, BigTiffToo) {
  std::vector<std::uint8_t> tiff{'I', 'I', 43, 0, 8, 0, 0, 0, 16, 0, 0, 0,
                                 0,   0,   0,  0, 2, 0, 0, 0, 0,  0, 0, 0};
  for (const auto& [tag, value] : {std::pair{262, 5}, {274, 6}})
    for (int byte : {tag & 255, tag >> 8, 3, 0, 1, 0, 0, 0, 0, 0, 0, 0, value, 0, 0, 0, 0, 0, 0, 0})
      tiff.push_back(static_cast<std::uint8_t>(byte));
  const ImageMetadata whole = read_image_metadata(ImageFormat::kTiff, tiff);
  EXPECT_TRUE(whole.cmyk);
  EXPECT_EQ(whole.orientation, 6);
  EXPECT_EQ(whole.foreign_colours, "");
  tiff[36] = 8;
  EXPECT_EQ(read_image_metadata(ImageFormat::kTiff, tiff).foreign_colours, "CIE L*a*b*");
  for (std::size_t n = 0; n < tiff.size(); ++n)  // reads nothing beyond, whatever is cut
    read_image_metadata(ImageFormat::kTiff, {tiff.data(), n});
}

TEST(ImageMetadata, DamagedProfilesAreToldFromNone) {
  const auto damaged = [](ImageFormat format, const Bytes& file) {
    const ImageMetadata metadata = read_image_metadata(format, file);
    EXPECT_TRUE(metadata.icc_profile.empty());
    return metadata.damaged_profile;
  };
  const Bytes jpeg = testing::jpeg_bytes(8, 8, 3), png = testing::png_bytes(8, 8, 3);
  EXPECT_FALSE(damaged(ImageFormat::kJpeg, jpeg));
  EXPECT_FALSE(damaged(ImageFormat::kPng, png));
  Bytes piece{'I', 'C', 'C', '_', 'P', 'R', 'O', 'F', 'I', 'L', 'E', 0, 1, 2, 9, 9};
  EXPECT_TRUE(damaged(ImageFormat::kJpeg, with_jpeg_segment(jpeg, 0xe2, piece))) << "1 of 2";
  piece.resize(12);
  EXPECT_TRUE(damaged(ImageFormat::kJpeg, with_jpeg_segment(jpeg, 0xe2, piece))) << "no number";
  Bytes half = iccp(adobe_icc());
  half.resize(half.size() / 2);
  EXPECT_TRUE(damaged(ImageFormat::kPng, png_with_chunk(png, "iCCP", half)));
  EXPECT_FALSE(damaged(ImageFormat::kPng, png_with_chunk(png_with_chunk(png, "iCCP", half), "sRGB", {0})));
  EXPECT_TRUE(damaged(ImageFormat::kPng, png_with_chunk(png, "iCCP", iccp(Bytes((16u << 20) + 1)))));
  const Bytes webp{'R', 'I', 'F', 'F', 0, 0, 0, 0, 'W', 'E', 'B', 'P', 'I', 'C', 'C', 'P', 9, 0, 0, 0, 1, 2};
  EXPECT_TRUE(damaged(ImageFormat::kWebp, webp));

  Image image = probe_image("bad.png", png_with_chunk(png, "iCCP", half), {});
  EXPECT_NO_THROW(decode_image(image, FloatEncoding::kSrgb));
  image.honour_profile = true;
  EXPECT_NO_THROW(decode_image(image, FloatEncoding::kAsIs));
  EXPECT_THROW(decode_image(image, FloatEncoding::kSrgb), InputError);
}

TEST(DecodeImage, DarkLinearWordsKeepTheirSteps) {
  std::vector<std::uint16_t> ramp;
  for (int i = 0; i < 256; ++i) ramp.push_back(static_cast<std::uint16_t>(i * 13));  // to 0.05
  Bytes gamma;
  put32(gamma, 100000);
  Image image = probe_image(
      "ramp.png",
      png_with_chunk(testing::encode_image("png", 256, 1, 1, ramp, OIIO::TypeDesc::UINT16), "gAMA", gamma),
      {});
  ASSERT_EQ(image.bits_per_channel, 16);
  image.honour_profile = true;
  const Bytes codes = decode_image(image, FloatEncoding::kSrgb).data;
  EXPECT_GT(std::set<int>(codes.begin(), codes.end()).size(), 50u);
  for (std::size_t i = 0; i < 256; ++i) {
    const double x = ramp[i] / 65535.0;
    EXPECT_NEAR(codes[i], 255 * (x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055), 0.51);
  }
}

TEST(DecodeImage, FloatsGoByTheirProfile) {
  const auto decoded = [](const Bytes& icc, bool honour) {
    OIIO::ImageSpec attributes;
    attributes.attribute("ICCProfile", OIIO::TypeDesc(OIIO::TypeDesc::UINT8, static_cast<int>(icc.size())),
                         icc.data());
    Image image = probe_image(
        "f.tif",
        testing::encode_image("tiff", 2, 1, 3, std::vector<float>{0.5f, 0.5f, 0.5f, 0.8f, -1, NAN},
                              OIIO::TypeDesc::FLOAT, attributes),
        {});
    image.honour_profile = honour;
    return decode_image(image, FloatEncoding::kSrgb).data;
  };
  EXPECT_EQ(decoded(srgb_icc(), false)[0], 188) << "floats are linear unless they say otherwise";
  const Bytes same = decoded(srgb_icc(), true), want{128, 128, 128, 204, 0, 0};
  for (std::size_t i = 0; i < want.size(); ++i) EXPECT_NEAR(same[i], want[i], 1) << i;
  EXPECT_EQ(decoded(rgb_icc(curve_of_points({})), true), decoded(srgb_icc(), false));
  const Bytes adobe = decoded(adobe_icc(), true);
  EXPECT_NEAR(adobe[0], 128, 2);
  EXPECT_GT(adobe[3], 215) << "a redder red than sRGB's";
}

TEST(DecodeImage, ColoursGoByTheProfileWhereItIsToBeHonoured) {
  const Bytes plain = testing::png_bytes(8, 8, 3);
  Image image = probe_image("a.png", png_with_chunk(plain, "iCCP", iccp(adobe_icc())), {});
  const Bytes stored = decode_image(probe_image("b.png", plain, {})).data;
  EXPECT_EQ(decode_image(image, FloatEncoding::kSrgb).data, stored) << "not unless asked";
  image.honour_profile = true;
  EXPECT_EQ(decode_image(image, FloatEncoding::kAsIs).data, stored) << "data are never converted";
  EXPECT_EQ(decode_image(image, FloatEncoding::kSrgb).data, converted(adobe_icc(), 3, stored));

  Image lut =
      probe_image("l.png", png_with_chunk(plain, "iCCP", iccp(make_icc("RGB ", {{"A2B0", Bytes(40)}}))), {});
  lut.honour_profile = true;
  EXPECT_EQ(decode_image(lut, FloatEncoding::kAsIs).data, stored);
  EXPECT_THROW(decode_image(lut, FloatEncoding::kSrgb), InputError);

  Image cmyk = probe_image("c.jpg",
                           jpeg_with_icc(testing::cmyk_jpeg(8, 8, {10, 20, 30, 40}, true),
                                         make_icc("CMYK", {{"A2B0", Bytes(40)}})),
                           {});
  EXPECT_NO_THROW(decode_image(cmyk, FloatEncoding::kSrgb));
  cmyk.honour_profile = true;
  EXPECT_THROW(decode_image(cmyk, FloatEncoding::kSrgb), InputError);

  Image turned = probe_image("t.jpg", with_jpeg_segment(testing::jpeg_bytes(16, 8, 3), 0xe1, exif(6)), {});
  EXPECT_EQ(turned.width_px, 16u) << "pixels stay as stored";
  EXPECT_EQ(decode_image(turned).data,
            decode_image(probe_image("u.jpg", testing::jpeg_bytes(16, 8, 3), {})).data);
}

}  // namespace texmesh::colour_profile_test
