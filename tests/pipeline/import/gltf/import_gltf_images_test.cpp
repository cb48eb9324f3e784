#include <gtest/gtest.h>

#include "stages/image/avif.h"
#include "tests/pipeline/import/gltf/textured_gltf.h"
#include "tests/support/images.h"
#include "tests/support/ktx2_writer.h"

namespace texmesh::import_gltf_images_test {

using namespace testing;  // NOLINT: fixtures

TEST(ImportGltfImages, ReadsImagesFromBufferViewsAndDataUris) {
  GltfBuilder b = textured(base_colour());
  b.json["images"] = {{{"bufferView", b.view_of(png())}, {"mimeType", "image/png"}, {"name", "skin/colour"}}};
  Model m = import_built(b);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
  EXPECT_EQ(m.images[0].name, "colour");
  b.json["images"] = {
      {{"uri",
        "data:image/png;base64,iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGA"
        "WjR9awAAAABJRU5ErkJggg=="}}};
  m = import_built(b);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
}

TEST(ImportGltfImages, PrefersWebpAndFallsBackWhenItIsMissing) {
  GltfBuilder b = textured(base_colour());
  b.json["images"].push_back({{"uri", "b.webp"}});
  b.json["textures"][0]["extensions"] = {{"EXT_texture_webp", {{"source", 1}}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"EXT_texture_webp"};
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  resolver.files["b.webp"] = webp();
  Model m = import_built(b, resolver);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].format, ImageFormat::kWebp);
  EXPECT_EQ(resolver.asked, (std::vector<std::string>{"b.webp"}));
  resolver.files.erase("b.webp");
  m = import_built(b, resolver);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].format, ImageFormat::kPng);
}

TEST(ImportGltfImages, AvifGoesOnAsAPngOfTheSameTexels) {
  const Pixels pixels{8, 6, 3, testing::test_picture(8, 6, 3)};
  GltfBuilder b = textured(base_colour());
  b.json["images"].push_back(
      {{"bufferView", b.view_of(encode_avif(pixels, {.quality = 99}))}, {"mimeType", "image/avif"}});
  b.json["textures"][0]["extensions"] = {{"EXT_texture_avif", {{"source", 1}}}};
  b.json["textures"][0].erase("source");
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"EXT_texture_avif"};
  const Model m = import_built(b);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].format, ImageFormat::kPng);
  const Pixels read = decode_image(m.images[0]);
  ASSERT_EQ(read.data.size(), pixels.data.size());
  for (std::size_t i = 0; i < read.data.size(); ++i) EXPECT_NEAR(read.data[i], pixels.data[i], 16) << i;
}

/// "a.png", and image 1 in a buffer view as the KTX2 of the texture.
GltfBuilder with_ktx2(const Bytes& file) {
  GltfBuilder b = textured(base_colour());
  b.json["images"].push_back({{"bufferView", b.view_of(file)}, {"mimeType", "image/ktx2"}});
  b.json["textures"][0]["extensions"] = {{"KHR_texture_basisu", {{"source", 1}}}};
  b.json["extensionsUsed"] = b.json["extensionsRequired"] = {"KHR_texture_basisu"};
  return b;
}

TEST(ImportGltfImages, ReadsPlainAndPackedKtx2) {
  for (const bool zstd : {false, true}) {
    const Bytes texels{1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
    testing::Ktx2Parts parts = testing::ktx2_parts(2, 2, 3, texels);
    parts.zstd = zstd;
    GltfBuilder b = with_ktx2(testing::ktx2_bytes(parts));
    for (const bool fallback : {true, false}) {
      if (!fallback) b.json["textures"][0].erase("source");
      const Model m = import_built(b);
      ASSERT_EQ(m.images.size(), 1u);
      EXPECT_EQ(m.images[0].format, ImageFormat::kPng);
      EXPECT_EQ(decode_image(m.images[0]).data, texels);
      EXPECT_TRUE(has_note(m, "ktx2-image", Severity::kInfo));
      EXPECT_FALSE(has_note(m, "unknown-extension", Severity::kInfo));
      EXPECT_TRUE(m.materials.at(0).base_colour_texture.used());
    }
  }
}

TEST(ImportGltfImages, BasisIsRefusedUnlessThereIsAnotherImage) {
  testing::Ktx2Parts basis = testing::ktx2_parts(2, 2, 3, Bytes(12));
  basis.vk_format = 0, basis.model = 166;
  GltfBuilder b = with_ktx2(testing::ktx2_bytes(basis));
  const Model m = import_built(b);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].bytes, png());
  ASSERT_TRUE(has_note(m, "ktx2-left-out", Severity::kWarning));
  EXPECT_NE(m.notes.front().text.find("Basis Universal"), std::string::npos) << m.notes.front().text;
  b.json["textures"][0].erase("source");
  try {
    import_built(b);
    FAIL() << "no refusal";
  } catch (const InputError& e) {
    EXPECT_NE(std::string(e.what()).find("Basis Universal cannot be read"), std::string::npos) << e.what();
    EXPECT_NE(std::string(e.what()).find("/images/1"), std::string::npos) << e.what();
  }
  b.json["textures"][0]["extensions"]["KHR_texture_basisu"]["source"] = 2;
  EXPECT_THROW(import_built(b), InputError) << "no such image";
}

TEST(ImportGltfImages, AMissingImageIsAWarning) {
  MemoryResolver empty;
  const Model m = import_built(textured(base_colour()), empty);
  EXPECT_TRUE(has_note(m, "missing-texture", Severity::kWarning));
  EXPECT_FALSE(m.materials.at(0).base_colour_texture.used());
  EXPECT_TRUE(m.images.empty());
}

TEST(ImportGltfImages, ATextureOfAnotherKindOnlyIsAWarning) {
  GltfBuilder b = textured(base_colour());
  b.json["textures"][0] = {{"extensions", {{"MSFT_texture_dds", {{"source", 0}}}}}};
  const Model m = import_built(b);
  EXPECT_TRUE(has_note(m, "missing-texture", Severity::kWarning));
  EXPECT_FALSE(m.materials.at(0).base_colour_texture.used());
}

TEST(ImportGltfImages, NeverOpensImagesOfUnusedMaterials) {
  GltfBuilder b = textured(base_colour());
  b.json["materials"].push_back(base_colour({{"index", 1}}));
  b.json["textures"].push_back({{"source", 1}});
  b.json["images"].push_back({{"uri", "unused.png"}});
  MemoryResolver resolver;
  resolver.files["a.png"] = png();
  EXPECT_EQ(import_built(b, resolver).materials.size(), 1u);
  EXPECT_EQ(resolver.asked, (std::vector<std::string>{"a.png"}));
}

TEST(ImportGltfImages, RefusesImagesOfForeignContent) {
  const auto refused = [](const char* uri, Bytes bytes) {
    GltfBuilder b = textured(base_colour());
    b.json["images"][0]["uri"] = uri;
    MemoryResolver resolver;
    resolver.files[uri] = std::move(bytes);
    try {
      import_built(b, resolver);
      ADD_FAILURE() << uri;
    } catch (const InputError& e) {
      EXPECT_EQ(e.file(), "m.glb") << e.what();
      EXPECT_EQ(e.place().rfind("/images/0", 0), 0u) << e.what();
    }
  };
  refused("a.png", {'G', 'I', 'F', '8', '9', 'a'});
}

}  // namespace texmesh::import_gltf_images_test
