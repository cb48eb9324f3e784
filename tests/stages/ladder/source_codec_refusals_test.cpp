// Sources whose own coefficients cannot be the top rung.
#include <gtest/gtest.h>

#include "tests/stages/ladder/source_scenes.h"

namespace texmesh::source_codec_refusals_test {

using namespace testing;  // NOLINT: fixtures

/// The note about a plane that is coded from its pixels.
std::string note_of(const Ladder& ladder) {
  EXPECT_FALSE(ladder.planes[0].source_rung);
  EXPECT_EQ(ladder.notes.size(), 1u);
  return ladder.notes.empty() ? "" : ladder.notes[0].text;
}

TEST(SourceCodec, JpegsThatCannotBeCutAreCodedAnewAndSaySo) {
  const Image wide = image_of(make_jpeg({"4:1:1", 3, 4, 1}, 64, 64));
  EXPECT_NE(note_of(encode(scene_of(wide, 16), asked({50}))).find("cross the borders"), std::string::npos);
  const Image coarse = image_of(make_jpeg({"16-bit quantisers", 3, 1, 1, false, false, 1}, 64, 64));
  EXPECT_NE(note_of(encode(scene_of(coarse), asked({50}))).find("exceed 255"), std::string::npos);
  const Image inks = image_of(testing::cmyk_jpeg(48, 48, {10, 20, 30, 40}, true));
  const std::string text = note_of(encode(scene_of(inks), asked({50, 97})));
  EXPECT_NE(text.find("converted"), std::string::npos) << text;
  EXPECT_NE(text.find("of 255 off on average"), std::string::npos) << text;
  Scene other = scene_of(image_of(make_jpeg({"4:4:4"}, 64, 64)));
  other.image = image_of(make_jpeg({"4:4:4"}, 64, 48));
  EXPECT_NE(note_of(encode(other, asked({50}))).find("another size"), std::string::npos);
}

TEST(SourceCodec, NoneForOtherFormatsMipsAlphaAndCodecs) {
  const auto has_one = [](Scene scene) {
    const SourceCodec source = make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, false, {});
    EXPECT_EQ(source.why_not, "");
    return source.codec != nullptr;
  };
  const Scene jpeg = scene_of(image_of(make_jpeg({""}, 64, 64)));
  EXPECT_TRUE(has_one(jpeg));
  EXPECT_FALSE(has_one(scene_of(image_of(testing::png_bytes(40, 40, 4)))));
  Scene other = jpeg;
  other.plane().mip = 1;
  EXPECT_FALSE(has_one(other));
  other = jpeg;
  other.plane().role = TextureRole::kAlpha;
  EXPECT_FALSE(has_one(other));
  LadderOptions webp = asked({50});
  webp.mode = LadderMode::kWebp;
  EXPECT_FALSE(encode(jpeg, webp).planes[0].source_rung);
}

TEST(SourceCodec, EveryTruncationHasNoCodec) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2}, 48, 48)));
  const Bytes whole = scene.image.bytes;
  for (std::size_t length = 2; length + 2 < whole.size(); length += 1 + length / 40) {
    scene.image.bytes.assign(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(length));
    try {
      const SourceCodec source =
          make_source_codec(scene.plane(), scene.pixels[0], scene.image, {}, false, {});
      EXPECT_FALSE(source.codec) << length;
      EXPECT_NE(source.why_not, "") << length;
    } catch (const InputError&) {  // the header's colour profile cannot be looked for
    }
  }
}

TEST(SourceCodec, FlippedBytesNeverCrash) {
  Scene scene = scene_of(image_of(make_jpeg({"", 3, 2, 2, true}, 48, 48)));
  const Bytes whole = scene.image.bytes;
  std::size_t taken = 0, refused = 0;
  for (std::size_t at = 2; at < whole.size(); at += 3) {
    scene.image.bytes = whole;
    scene.image.bytes[at] ^= 0x5a;
    try {
      const Ladder ladder = encode(scene, asked({40}));
      if (ladder.planes[0].source_rung) {
        ++taken;
        for (std::size_t r = 0; r < ladder.planes[0].rungs.size(); ++r)
          decode_fragment(ladder.planes[0], r, 0, 1 << 20);
      } else {
        ++refused;
      }
    } catch (const InputError&) {
      ++refused;
    }
  }
  EXPECT_GT(taken, 0u);
  EXPECT_GT(refused, 0u);
}

}  // namespace texmesh::source_codec_refusals_test
