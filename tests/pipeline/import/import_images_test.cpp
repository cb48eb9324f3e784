#include "pipeline/import/import_images.h"

#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "stages/image/decode_image.h"
#include "tests/support/images.h"
#include "tests/support/ktx2_writer.h"
#include "tests/support/memory_resolver.h"
#include "tests/support/meshes.h"

namespace texmesh::import_images_test {

using testing::bytes_of;
using testing::count_notes;
using testing::input_error;
using testing::MemoryResolver;

TEST(AddImage, OneEntryPerContentOneWarningPerName) {
  Model m;
  MemoryResolver resolver;
  resolver.files["a/x.png"] = testing::png_bytes(4, 4, 3);
  resolver.files["b/x.png"] = testing::png_bytes(4, 4, 4);
  EXPECT_EQ(add_image(m, {"a/x.png", "", false}, resolver, "f", "p", {}), 0);
  EXPECT_EQ(add_image(m, {"b/x.png", "", false}, resolver, "f", "p", {}), 1);
  EXPECT_EQ(add_image(m, {"a/x.png", "", false}, resolver, "f", "p", {}), 0);
  EXPECT_EQ(m.images[0].name, "x.png");
  EXPECT_EQ(add_image(m, {"gone.png", "", false}, resolver, "f", "p", {}), -1);
  EXPECT_EQ(add_image(m, {"gone.png", "", false}, resolver, "f", "q", {}), -1);
  EXPECT_EQ(count_notes(m, "missing-texture"), 1);
  EXPECT_EQ(add_image(m, {"../x.png", "", false}, resolver, "f", "p", {}), -1);
  ImportOptions options;
  options.max_image_pixels = 15;
  resolver.files["c.png"] = testing::png_bytes(4, 4, 1);
  const std::string error = input_error([&] {
    add_image(m, {"c.png", "", false}, resolver, "model.obj", "material", options);
  });
  EXPECT_NE(error.find("model.obj"), std::string::npos) << error;
  EXPECT_NE(error.find("c.png"), std::string::npos) << error;
}

TEST(AddImage, OtherPicturesBecomeThoseThatPackagesKeep) {
  Model m;
  MemoryResolver resolver;
  const Bytes texels = testing::test_picture(8, 8, 3);
  for (const auto& [name, writer] : {std::pair{"a.bmp", "bmp"}, {"b.TGA", "targa"}})
    resolver.files[name] = testing::encode_image(writer, 8, 8, 3, texels, OIIO::TypeDesc::UINT8);
  const std::vector<float> light(4 * 4 * 3, 0.5f);
  resolver.files["c.hdr"] = testing::encode_image("hdr", 4, 4, 3, light, OIIO::TypeDesc::FLOAT);
  EXPECT_EQ(add_image(m, {"a.bmp", "", false}, resolver, "f", "p", {}), 0);
  EXPECT_EQ(add_image(m, {"b.TGA", "", false}, resolver, "f", "p", {}), 0)
      << "the same texels are the same image";
  EXPECT_EQ(add_image(m, {"c.hdr", "", false}, resolver, "f", "p", {}), 1);
  EXPECT_EQ(add_image(m, {"a.bmp", "", false}, resolver, "f", "q", {}), 0);
  EXPECT_EQ(count_notes(m, "converted-image"), 2);
  EXPECT_EQ(decode_image(m.images[0], FloatEncoding::kSrgb).data, texels);
  EXPECT_EQ(decode_image(m.images[1], FloatEncoding::kSrgb).data[0], 188);
  resolver.files["cut.bmp"] = {resolver.files["a.bmp"].begin(), resolver.files["a.bmp"].begin() + 100};
  const std::string error = input_error([&] {
    add_image(m, {"cut.bmp", "", false}, resolver, "model.obj", "material", {});
  });
  EXPECT_NE(error.find("model.obj"), std::string::npos) << error;
  EXPECT_NE(error.find("cut.bmp"), std::string::npos) << error;
}

TEST(AddImage, AKtx2IsReadByItsContentAndOnce) {
  Model m;
  MemoryResolver resolver;
  const Bytes texels = testing::test_picture(4, 4, 3);
  resolver.files["x.ktx2"] = testing::ktx2_bytes(testing::ktx2_parts(4, 4, 3, texels));
  resolver.files["y.png"] = resolver.files["x.ktx2"];
  resolver.files["light.ktx2"] = testing::ktx2_bytes(testing::ktx2_parts(4, 4, 3, texels, false));
  EXPECT_EQ(add_image(m, {"x.ktx2", "", false}, resolver, "f", "p", {}), 0);
  EXPECT_EQ(add_image(m, {"y.png", "", false}, resolver, "f", "p", {}), 0);
  EXPECT_EQ(count_notes(m, "ktx2-image"), 1);
  EXPECT_EQ(count_notes(m, "colour-profile"), 0);
  EXPECT_EQ(decode_image(m.images[0], FloatEncoding::kSrgb).data, texels);
  EXPECT_EQ(add_image(m, {"light.ktx2", "", false}, resolver, "f", "p", {}), 1);
  EXPECT_EQ(count_notes(m, "colour-profile"), 1);
  EXPECT_EQ(decode_image(m.images[1]).data, texels);
  const Bytes lit = decode_image(m.images[1], FloatEncoding::kSrgb).data;
  for (std::size_t i = 0; i < texels.size(); ++i) EXPECT_GE(lit[i], texels[i]);
  EXPECT_NE(lit, texels) << "light becomes sRGB where it gives colours";
  resolver.files["z.ktx2"] = {resolver.files["x.ktx2"].begin(), resolver.files["x.ktx2"].end() - 1};
  const std::string error = input_error([&] {
    add_image(m, {"z.ktx2", "", false}, resolver, "model.obj", "material", {});
  });
  EXPECT_NE(error.find("z.ktx2"), std::string::npos) << error;
  EXPECT_NE(error.find("level 0"), std::string::npos) << error;
}

TEST(AddImage, NotesSayWhatBecomesOfColoursAndOrientation) {
  testing::MemoryResolver resolver;
  std::vector<std::uint8_t> exif{0xff, 0xd8, 0xff, 0xe1, 0, 34, 'E', 'x', 'i', 'f',  0, 0, 'I',
                                 'I',  42,   0,    8,    0, 0,  0,   1,   0,   0x12, 1, 3, 0,
                                 1,    0,    0,    0,    6, 0,  0,   0,   0,   0,    0, 0};
  const auto jpeg = testing::jpeg_bytes(8, 8, 3);
  exif.insert(exif.end(), jpeg.begin() + 2, jpeg.end());
  resolver.files["turned.jpg"] = exif;
  resolver.files["inks.jpg"] = testing::cmyk_jpeg(8, 8, {1, 2, 3, 4}, true);
  Model m;
  add_image(m, {"turned.jpg", "", false}, resolver, "f", "p", {});
  add_image(m, {"inks.jpg", "", false}, resolver, "f", "p", {.colour_profiles = ProfilePolicy::kIgnore});
  EXPECT_EQ(count_notes(m, "exif-orientation"), 1);
  EXPECT_EQ(count_notes(m, "cmyk-image"), 1);
  for (const Note& note : m.notes) EXPECT_EQ(note.severity, Severity::kWarning) << note.code;
  EXPECT_EQ(m.images[0].width_px, 8u);
  EXPECT_TRUE(m.images[0].honour_profile);
  EXPECT_FALSE(m.images[1].honour_profile);
}

TEST(AddImage, AColourProfileThatCannotBeUsedIsIgnoredAsBrowsersDo) {
  const auto jpeg = testing::jpeg_bytes(8, 8, 3);
  std::vector<std::uint8_t> odd{0xff, 0xd8, 0xff, 0xe2, 0, 20};
  for (const char c : std::string("ICC_PROFILE\0\1\1none", 18)) odd.push_back(static_cast<std::uint8_t>(c));
  odd.insert(odd.end(), jpeg.begin() + 2, jpeg.end());
  testing::MemoryResolver resolver;
  resolver.files["odd.jpg"] = odd;
  Model m;
  add_image(m, {"odd.jpg", "", false}, resolver, "f", "p", {});
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_FALSE(m.images[0].honour_profile);
  EXPECT_EQ(decode_image(m.images[0], FloatEncoding::kSrgb).data,
            decode_image(probe_image("plain", jpeg, {}), FloatEncoding::kSrgb).data);
  EXPECT_EQ(count_notes(m, "colour-profile-ignored"), 1);
  Model strict;
  add_image(strict, {"odd.jpg", "", false}, resolver, "f", "p", {.colour_profiles = ProfilePolicy::kHonour});
  EXPECT_THROW(decode_image(strict.images[0], FloatEncoding::kSrgb), InputError)
      << "where the user asks for it";
}

TEST(AddImage, NotesSayThatTheFirstOfMorePicturesIsRead) {
  testing::MemoryResolver resolver;
  const auto png = testing::png_bytes(8, 8, 3);
  std::vector<std::uint8_t> frames(png.begin(), png.begin() + 33);  // signature and IHDR
  frames.insert(frames.end(),
                {0, 0, 0, 8, 'a', 'c', 'T', 'L', 0, 0, 0, 2, 0, 0, 0, 0, 0xf3, 0x8d, 0x93, 0x70});
  frames.insert(frames.end(), png.begin() + 33, png.end());
  resolver.files["frames.png"] = frames;
  resolver.files["still.png"] = png;
  Model m;
  add_image(m, {"still.png", "", false}, resolver, "f", "p", {});
  EXPECT_EQ(count_notes(m, "more-pictures"), 0);
  add_image(m, {"frames.png", "", false}, resolver, "f", "p", {});
  EXPECT_EQ(count_notes(m, "more-pictures"), 1);
}

}  // namespace texmesh::import_images_test
