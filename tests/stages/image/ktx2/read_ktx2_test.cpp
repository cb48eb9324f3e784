#include "stages/image/ktx2/read_ktx2.h"

#include <gtest/gtest.h>

#include "stages/image/image_metadata.h"
#include "tests/stages/image/image_files.h"
#include "tests/support/ktx2_writer.h"

namespace texmesh::read_ktx2_test {

using namespace testing;  // NOLINT: fixtures

Ktx2Picture read(const Ktx2Parts& parts) { return read_ktx2("k.ktx2", ktx2_bytes(parts), {}); }

std::string refusal(const Ktx2Parts& parts) {
  return error_of([&] { read(parts); });
}

Ktx2Parts small(int channels = 3) { return ktx2_parts(7, 5, channels, test_picture(7, 5, channels)); }

/// With a level of half the size.
Ktx2Parts with_mip() {
  Ktx2Parts parts = small();
  parts.levels.push_back(test_picture(3, 2, 3));
  return parts;
}

TEST(ReadKtx2, EveryChannelCountPlainAndPacked) {
  for (const bool zstd : {false, true})
    for (const bool srgb : {false, true})
      for (int channels = 1; channels <= 4; ++channels) {
        const Bytes texels = test_picture(40, 30, channels);
        Ktx2Parts parts = ktx2_parts(40, 30, channels, texels, srgb);
        parts.zstd = zstd;
        const Ktx2Picture picture = read(parts);
        Bytes expected = texels;
        if (channels == 2) {
          expected.clear();
          for (std::size_t i = 0; i < texels.size(); i += 2)
            expected.insert(expected.end(), {texels[i], texels[i + 1], 0});
        }
        EXPECT_EQ(picture.pixels.channels, channels == 2 ? 3u : static_cast<std::uint32_t>(channels));
        EXPECT_EQ(picture.pixels.width_px, 40u);
        EXPECT_EQ(picture.pixels.height_px, 30u);
        EXPECT_EQ(picture.pixels.data, expected) << channels;
        EXPECT_EQ(picture.linear, !srgb);
      }
}

TEST(ReadKtx2, AFormatThatSaysNothingOfLightIsNoLight) {
  Ktx2Parts parts = ktx2_parts(7, 5, 3, test_picture(7, 5, 3), false);
  parts.transfer = 0;
  EXPECT_FALSE(read(parts).linear);
}

TEST(ReadKtx2, AsAPngItHasTheSameTexels) {
  for (const bool srgb : {false, true})
    for (const int channels : {1, 3, 4}) {
      const Bytes texels = test_picture(40, 30, channels);
      const Image png =
          probe(png_of_ktx2("k.ktx2", ktx2_bytes(ktx2_parts(40, 30, channels, texels, srgb)), {}));
      EXPECT_EQ(png.format, ImageFormat::kPng);
      EXPECT_EQ(decode_image(png).data, texels);
      EXPECT_EQ(read_image_metadata(png.format, png.bytes).gamma, srgb ? 0.0 : 1.0);
    }
}

TEST(ReadKtx2, SwizzlesAndOrientation) {
  Ktx2Parts parts = ktx2_parts(1, 2, 2, {10, 20, 30, 40});
  parts.keys = {{"KTXswizzle", "rrrg"}, {"KTXwriter", "a test"}};
  EXPECT_EQ(read(parts).pixels.data, (Bytes{10, 10, 10, 20, 30, 30, 30, 40})) << "grey with alpha";
  parts.keys = {{"KTXswizzle", "ba01"}};
  EXPECT_EQ(read(parts).pixels.data, (Bytes{0, 255, 0, 0, 255, 0})) << "blue is missing, alpha too";
  parts.keys = {{"KTXswizzle", "ggg1"}, {"KTXorientation", "ru"}};
  EXPECT_EQ(read(parts).pixels.data, (Bytes{40, 20}));
  parts.keys = {{"KTXorientation", "rd"}};
  EXPECT_EQ(read(parts).pixels.data, (Bytes{10, 20, 0, 30, 40, 0}));
  for (const auto& [key, value] : {std::pair{"KTXorientation", "ld"},
                                   {"KTXorientation", "rdi"},
                                   {"KTXswizzle", "rgb"},
                                   {"KTXswizzle", "rgbx"}}) {
    parts.keys = {{key, value}};
    EXPECT_NE(refusal(parts).find(key), std::string::npos) << value;
  }
}

TEST(ReadKtx2, OnlyTheLargestLevelIsRead) {
  const Ktx2Picture picture = read(with_mip());
  EXPECT_EQ(picture.levels, 2u);
  EXPECT_EQ(picture.pixels.data, test_picture(7, 5, 3));
  Ktx2Parts wrong = with_mip();
  wrong.levels[1].pop_back();
  EXPECT_NE(refusal(wrong).find("level 1"), std::string::npos);
  Bytes far = ktx2_bytes(with_mip());
  far[80 + 24 + 3] = 1;  // 16 MB behind the file
  EXPECT_NE(error_of([&] { read_ktx2("k", far, {}); }).find("level 1"), std::string::npos);
  Ktx2Parts many = small();
  many.levels.resize(4, many.levels[0]);
  EXPECT_NE(refusal(many).find("at most 3 levels"), std::string::npos);
}

TEST(ReadKtx2, BasisIsRefusedWithASentence) {
  Ktx2Parts uastc = small();
  uastc.vk_format = 0, uastc.model = 166;
  Ktx2Parts packed = uastc;
  packed.zstd = true;
  Ktx2Parts etc1s = small();
  etc1s.vk_format = 0, etc1s.model = 163, etc1s.scheme = 1;
  for (const Ktx2Parts& parts : {uastc, packed, etc1s}) {
    const std::string error = refusal(parts);
    EXPECT_NE(error.find("Basis Universal cannot be read; convert the file with `ktx extract"),
              std::string::npos)
        << error;
    EXPECT_NE(error.find(parts.model == 166 ? "(UASTC)" : "(ETC1S)"), std::string::npos) << error;
  }
}

TEST(ReadKtx2, OtherKindsAreRefusedByName) {
  const auto expect = [](const char* words, auto&& change) {
    Ktx2Parts parts = small();
    change(parts);
    const std::string error = refusal(parts);
    EXPECT_NE(error.find(words), std::string::npos) << words << ": " << error;
  };
  expect("ZLIB", [](Ktx2Parts& p) { p.scheme = 3; });
  expect("supercompression scheme 4", [](Ktx2Parts& p) { p.scheme = 4; });
  expect("VkFormat 145, blocks of a GPU", [](Ktx2Parts& p) { p.vk_format = 145; });
  expect("VkFormat 97", [](Ktx2Parts& p) { p.vk_format = 97; });
  expect("VkFormat 0", [](Ktx2Parts& p) { p.vk_format = 0; });
  expect("depth", [](Ktx2Parts& p) { p.depth = 5; });
  expect("layers", [](Ktx2Parts& p) { p.layers = 2; });
  expect("faces", [](Ktx2Parts& p) { p.faces = 6; });
  expect("multiplied in", [](Ktx2Parts& p) { p.flags = 1; });
  expect("primaries", [](Ktx2Parts& p) { p.primaries = 10; });
  expect("colour model", [](Ktx2Parts& p) { p.model = 128; });
  expect("at least 1 x 1", [](Ktx2Parts& p) { p.height = 0; });
  expect("105 bytes", [](Ktx2Parts& p) { p.levels[0].pop_back(); });
  expect("level 0", [](Ktx2Parts& p) { p.scheme = 2; });  // texels that are no frame
}

TEST(ReadKtx2, LimitsComeBeforeMemory) {
  ImageLimits limits;
  limits.max_side_px = 6;
  EXPECT_THROW(read_ktx2("k", ktx2_bytes(small()), limits), InputError);
  limits = {};
  limits.max_pixels = 34;
  EXPECT_THROW(read_ktx2("k", ktx2_bytes(small()), limits), InputError);
  Ktx2Parts huge = small(4);
  huge.zstd = true;
  huge.width = huge.height = ~0u;
  EXPECT_NE(refusal(huge).find("65500"), std::string::npos);
}

TEST(ReadKtx2, AFrameOfAnotherSizeIsRefused) {
  for (const int more : {-1, 1}) {
    Ktx2Parts parts = small();
    parts.zstd = true;
    parts.levels[0].resize(105 + more);
    Bytes file = ktx2_bytes(parts);
    file[80 + 16] = 105;  // what the index says of it
    EXPECT_NE(error_of([&] { read_ktx2("k", file, {}); }).find("frame of 105 bytes"), std::string::npos);
  }
}

TEST(ReadKtx2, EveryTruncationIsRefused) {
  for (const bool zstd : {false, true}) {
    Ktx2Parts parts = with_mip();
    parts.zstd = zstd;
    parts.keys = {{"KTXorientation", "rd"}};
    const Bytes file = ktx2_bytes(parts);
    for (std::size_t n = 0; n < file.size(); ++n)
      EXPECT_THROW(read_ktx2("k", ByteSpan(file).first(n), {}), InputError) << n;
  }
}

/// Each byte of the header, index, descriptor and keys flipped: refused as input, or a picture of its size.
TEST(ReadKtx2, FlippedBytesAreRefusedOrRead) {
  for (const bool zstd : {false, true}) {
    Ktx2Parts parts = with_mip();
    parts.zstd = zstd;
    parts.keys = {{"KTXorientation", "rd"}};
    const Bytes file = ktx2_bytes(parts);
    int refused = 0;
    for (std::size_t at = 0; at < file.size(); ++at)
      for (const int bit : {1, 0x10, 0x80}) {
        Bytes flipped = file;
        flipped[at] ^= static_cast<std::uint8_t>(bit);
        try {
          const Ktx2Picture picture = read_ktx2("k", flipped, {});
          EXPECT_EQ(picture.pixels.data.size(),
                    picture.pixels.width_px * picture.pixels.height_px * picture.pixels.channels);
        } catch (const InputError&) {
          ++refused;
        }
      }
    EXPECT_GT(refused, 300);
  }
}

}  // namespace texmesh::read_ktx2_test
