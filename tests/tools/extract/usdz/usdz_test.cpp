// USDZ from made GLBs: what the file holds, where it stands, and what is refused. Readers of others look at
// the same files in tests/browser/usdz-tests.mjs.
#include "tools/extract/usdz/usdz.h"

#include <gtest/gtest.h>

#include "format/container/container.h"
#include "tests/support/check_crc.h"
#include "tests/support/gltf_builder.h"
#include "tests/support/images.h"

namespace texmesh::usdz_test {

using Json = nlohmann::json;
using testing::GltfBuilder;

Bytes made_image(const char* type, int channels) {
  return testing::encode_image(type, 2, 2, channels, std::vector<std::uint8_t>(std::size_t{4} * channels, 90),
                               OIIO::TypeDesc::UINT8);
}

/// A square of `cells` x `cells` with a material, its textures' images and a place.
struct Square {
  Json material = Json::object();
  std::vector<std::pair<std::string, Bytes>> images;  // media type, file
  bool colours = false, normals = true;
  int cells = 8;

  Extracted extracted() const {
    GltfBuilder b;
    std::vector<float> positions, uvs, colour, normal;
    std::vector<std::uint16_t> indices;
    for (int y = 0; y <= cells; ++y)
      for (int x = 0; x <= cells; ++x) {
        const float u = static_cast<float>(x) / static_cast<float>(cells),
                    v = static_cast<float>(y) / static_cast<float>(cells);
        positions.insert(positions.end(), {u, v, u * v});
        uvs.insert(uvs.end(), {u, v});
        colour.insert(colour.end(), {u, 0.5f, v});
        const Vec3f n = to_float(normalized(Vec3d{-v, -u, 1}));
        normal.insert(normal.end(), {n.x, n.y, n.z});
      }
    for (int y = 0; y < cells; ++y)
      for (int x = 0; x < cells; ++x) {
        const int a = y * (cells + 1) + x, c = a + cells + 1;
        for (int i : {a, a + 1, c + 1, a, c + 1, c}) indices.push_back(static_cast<std::uint16_t>(i));
      }
    Json attributes{{"POSITION", b.attribute(positions, "VEC3", {{"min", {0, 0, 0}}, {"max", {1, 1, 1}}})},
                    {"TEXCOORD_0", b.attribute(uvs, "VEC2")}};
    if (normals) attributes["NORMAL"] = b.attribute(normal, "VEC3");
    if (colours) attributes["COLOR_0"] = b.attribute(colour, "VEC3");
    for (const auto& [type, bytes] : images)
      b.push("textures",
             {{"source", b.push("images", {{"bufferView", b.view_of(bytes)}, {"mimeType", type}})}});
    b.push("materials", material);
    b.mesh(attributes, {{"indices", b.attribute(indices, "SCALAR")}, {"material", 0}});
    b.node({{"mesh", 0}, {"translation", {0.0, 0.0, 4096.0}}});
    Extracted out;
    out.glb = b.glb();
    out.levels = {0};
    return out;
  }
};

std::string usdz_text(const Square& square, const About& about = {}) {
  const Bytes file = usdz_of(square.extracted(), about, "x", {}).file;
  return {file.begin(), file.end()};
}

std::string refusal_of(const Square& square) {
  try {
    usdz_text(square);
  } catch (const InputError& e) {
    return e.found();
  }
  return "";
}

bool has(const std::string& text, std::string_view part) { return text.find(part) != std::string::npos; }

Square textured() {
  const Bytes jpeg = made_image("jpg", 3), png = made_image("png", 4);
  Square s;
  s.images = {{"image/jpeg", jpeg}, {"image/png", png}};
  s.material = {{"pbrMetallicRoughness", {{"baseColorTexture", {{"index", 1}}}}},
                {"emissiveTexture", {{"index", 0}}},
                {"emissiveFactor", {0.5, 0.5, 0.5}},
                {"alphaMode", "MASK"}};
  return s;
}

TEST(Usdz, IsAContainerOfWhichEveryFileIsAlignedAndPicturesStay) {
  const Square s = textured();
  const Bytes file = usdz_of(s.extracted(), {}, "x", {}).file;
  const auto source = memory_source(file);
  const std::vector<ContainerEntry> entries = read_container(*source);
  ASSERT_EQ(entries.size(), 3u);
  EXPECT_EQ(entries[0].path, "model.usdc");
  for (const ContainerEntry& e : entries) {
    EXPECT_EQ(e.offset % 64, 0u) << e.path;
    check_crc(*source, e);
  }
  for (const auto& [type, bytes] : s.images)
    EXPECT_NE(std::search(file.begin(), file.end(), bytes.begin(), bytes.end()), file.end()) << type;
  EXPECT_TRUE(has({file.begin(), file.end()}, "PXR-USDC"));
}

TEST(Usdz, IsTheSameEachTimeAndNoLargerThanAPlainGlb) {
  Square s = textured();
  s.cells = 60;
  const Extracted glb = s.extracted();
  const Bytes file = usdz_of(glb, {}, "x", {}).file;
  EXPECT_EQ(file, usdz_of(glb, {}, "x", {}).file);
  EXPECT_LT(static_cast<double>(file.size()), 1.15 * static_cast<double>(glb.glb.size()));
}

TEST(Usdz, SaysMaterialsUnitAndRights) {
  About about;
  about.title = "A bust";
  about.creator = "N. N.";
  about.licence = "CC-BY-4.0";
  about.unit = "cm";
  about.metres_per_unit = 0.01;
  const std::string text = usdz_text(textured(), about);
  for (const char* part :
       {"UsdPreviewSurface", "UsdUVTexture", "inputs:opacityThreshold", "inputs:emissiveColor", "outputs:a",
        "textures/0.png", "metersPerUnit", "A bust", "CC-BY-4.0", "xformOp:transform"})
    EXPECT_TRUE(has(text, part)) << part;
  const double metres = 0.01;
  EXPECT_TRUE(has(text, {reinterpret_cast<const char*>(&metres), sizeof metres}));
  EXPECT_FALSE(has(text, "displayColor"));
  EXPECT_FALSE(has(text, "inputs:clearcoat"));
}

TEST(Usdz, AMeshWithoutNormalsHasThoseOfItsFaces) {
  Square s;
  EXPECT_FALSE(has(usdz_text(s), "primvars:normals"));
  s.normals = false;
  const std::string text = usdz_text(s);
  for (const char* part : {"primvars:normals", "primvars:normals:indices", "faceVarying"})
    EXPECT_TRUE(has(text, part)) << part;
  s.material = {{"extensions", {{"KHR_materials_unlit", Json::object()}}}};
  EXPECT_FALSE(has(usdz_text(s), "primvars:normals")) << "no light falls on it";
}

TEST(Usdz, TextureTransformsGoIntoTheCoordinates) {
  Square s = textured();
  s.material["pbrMetallicRoughness"]["baseColorTexture"]["extensions"]["KHR_texture_transform"] = {
      {"offset", {0.25, 0.5}}, {"scale", {2, 2}}};
  const std::string text = usdz_text(s);
  EXPECT_TRUE(has(text, "primvars:st1")) << "the emission reads others";
  const std::array<float, 2> last{2.25f, 1 - 2.5f};
  EXPECT_TRUE(has(text, {reinterpret_cast<const char*>(last.data()), sizeof last}));
}

TEST(Usdz, VertexColoursStandForATextureAlone) {
  Square s;
  s.colours = true;
  EXPECT_TRUE(has(usdz_text(s), "primvars:displayColor"));
  Square both = textured();
  both.colours = true;
  EXPECT_EQ(refusal_of(both).substr(0, 31), "vertex colours beside a texture");
}

TEST(Usdz, RefusesWhatTheSurfaceCannotSay) {
  Square s = textured();
  s.material["extensions"]["KHR_materials_transmission"] = {{"transmissionFactor", 1.0}};
  EXPECT_TRUE(has(refusal_of(s), "KHR_materials_transmission"));
  s.material["extensions"] = {{"KHR_materials_clearcoat", {{"clearcoatFactor", 1.0}}}};
  EXPECT_TRUE(has(usdz_text(s), "inputs:clearcoat"));
  Extracted levels = s.extracted();
  levels.levels = {0, 1};
  EXPECT_THROW(usdz_of(levels, {}, "x", {}), InputError);
}

TEST(Usdz, WebpBecomesJpegAndIsTold) {
  Square s = textured();
  s.images[0] = {"image/webp", made_image("webp", 3)};
  const Usdz usdz = usdz_of(s.extracted(), {}, "x", {});
  EXPECT_TRUE(has({usdz.file.begin(), usdz.file.end()}, "textures/1.jpg") ||
              has({usdz.file.begin(), usdz.file.end()}, "textures/0.jpg"));
  ASSERT_EQ(usdz.notes.size(), 1u);
  EXPECT_TRUE(has(usdz.notes[0], "WebP"));
}

}  // namespace texmesh::usdz_test
