// Materials of MTL files, and the libraries and textures they name.
#include "pipeline/import/obj/obj_material.h"

#include <gtest/gtest.h>

#include "stages/image/decode_image.h"
#include "tests/pipeline/import/obj/obj_cases.h"

namespace texmesh::obj_material_test {

using namespace testing;  // NOLINT: fixtures

TEST(ObjMaterial, MissingMtlAndMissingTextureAreWarnings) {
  Model m = import_text(kTextured);
  EXPECT_EQ(count_notes(m, "missing-mtl"), 1);
  EXPECT_EQ(m.materials[0].name, "m");
  EXPECT_FALSE(m.materials[0].base_colour_texture.used());
  const MtlCase gone("Kd 0.5 0 0\nmap_Kd gone.png\n");
  EXPECT_EQ(count_notes(gone.model, "missing-texture"), 1);
  EXPECT_NEAR(gone.material().base_colour.x, 0.21404, 1e-4) << "then Kd is the colour";
  EXPECT_EQ(gone.material().base_colour.y, 0);
}

TEST(ObjMaterial, LibrariesWithBlanksAndSeveralInOneLine) {
  MemoryResolver resolver;
  resolver.files["my scan.mtl"] = bytes_of("newmtl m\nKd 1 0 0\n");
  EXPECT_EQ(import_text("mtllib my scan.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n", resolver)
                .materials[0]
                .base_colour.y,
            0);
  resolver.files = {{"x.mtl", bytes_of("newmtl other\n")}, {"y.mtl", bytes_of("newmtl m\nKd 0 1 0\n")}};
  EXPECT_EQ(import_text("mtllib x.mtl y.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n", resolver)
                .materials[0]
                .base_colour.x,
            0);
  const Model half = import_text("mtllib x.mtl gone.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n", resolver);
  EXPECT_EQ(count_notes(half, "missing-mtl"), 1);
  EXPECT_EQ(count_notes(half, "missing-material"), 1);
}

TEST(ObjMaterial, CommentsBehindNamesOfMaterials) {
  const std::string mtl = "newmtl m # the skin\nKd 0 1 0\nnewmtl n #1\nKd 1 0 0\nnewmtl n\n";
  for (const auto& [name, green] : {std::pair("m", 1.f), {"m # used", 1.f}, {"n #1", 0.f}, {"n #2", 0.6f}}) {
    MemoryResolver resolver;
    resolver.files["a.mtl"] = bytes_of(mtl);
    const Model model =
        import_text("mtllib a.mtl\n" + kVertices + "usemtl " + name + "\nf 1 2 3\n", resolver);
    EXPECT_EQ(count_notes(model, "missing-material"), 0) << name;
    EXPECT_EQ(model.materials[0].base_colour.y, green) << name;
  }
}

TEST(ObjMaterial, AMaterialThatIsThereTwiceIsOne) {
  MemoryResolver resolver;
  resolver.files["a.mtl"] =
      bytes_of("newmtl m\nmap_Kd c.png\nKd 0 1 0\nnewmtl n\nKd 0 0 1\nnewmtl m\nKd 1 0 0\nnewmtl m\n");
  const Model once = import_text(kTextured, resolver);
  EXPECT_EQ(once.materials[0].base_colour.x, 1);
  EXPECT_EQ(once.materials[0].base_colour.y, 0);
  EXPECT_EQ(count_notes(once, "missing-texture"), 1) << "the map of the first one";
  EXPECT_EQ(count_notes(once, "repeated-material"), 1);
}

TEST(ObjMaterial, ALibrarysOnlyMaterialIsMeantWhereNoFaceNamesOne) {
  const auto red = [](const std::string& mtl, const std::string& use) {
    MemoryResolver resolver;
    resolver.files["a.mtl"] = bytes_of(mtl);
    const Model m = import_text("mtllib a.mtl\n" + kVertices + use, resolver);
    const bool is_red = m.materials[m.mesh.triangle_material[0]].base_colour.y == 0;
    EXPECT_EQ(count_notes(m, "other-material"), is_red ? 1 : 0) << use;
    EXPECT_EQ(count_notes(m, "missing-material"), is_red ? 0 : 1) << use;
    return is_red;
  };
  const std::string one = "newmtl Skin\nKd 1 0 0\n", faces = "f 1 2 3\nf 1 3 4\n";
  for (const std::string use : {"", "usemtl\n", "usemtl (null)\n", "usemtl skin\n", "usemtl ns:Skin\n"})
    EXPECT_TRUE(red(one, use + faces)) << use;
  EXPECT_FALSE(red(one + "newmtl b\n", faces)) << "several";
  EXPECT_FALSE(red(one, "f 1 2 3\nusemtl Skin\nf 1 3 4\n")) << "the other faces have it";
  MemoryResolver half;
  half.files["a.mtl"] = bytes_of(one);
  EXPECT_EQ(count_notes(import_text("mtllib a.mtl gone.mtl\n" + kVertices + faces, half), "other-material"),
            0)
      << "it may be in the library that is missing";
}

TEST(ObjMaterial, AMessageNamesTheMaterialsThatAreThere) {
  MemoryResolver resolver;
  resolver.files["a.mtl"] = bytes_of("newmtl p\nnewmtl q\nnewmtl r\nnewmtl s\n");
  const Model m = import_text(kTextured, resolver);
  ASSERT_EQ(count_notes(m, "missing-material"), 1);
  EXPECT_NE(m.notes.back().text.find("there are \"p\", \"q\", \"r\" and 1 more"), std::string::npos)
      << m.notes.back().text;
}

TEST(ObjMaterial, TextureNamesWithBlanksOptionsAndTrailingBlanks) {
  for (const char* line : {"map_Kd a b.png", "map_Kd   a b.png \t", "map_Kd -s 1 1 1 -o 0 0 0 a b.png",
                           "map_Kd -clamp on a b.png", "map_Kd -blendu on -mm 0 1 -texres 512 a b.png\r",
                           "map_Kd \"a b.png\"", "map_Ka a b.png", "MAP_KD a b.png"})
    EXPECT_EQ(MtlCase(std::string(line) + "\n").image_name(), "a b.png") << line;
  EXPECT_EQ(MtlCase("map_Kd .\\c.png\n").resolver.asked.back(), "c.png");
  EXPECT_EQ(MtlCase("map_Kd -clamp on c.png\n").material().base_colour_texture.wrap_s, Wrap::kClamp);
  EXPECT_EQ(MtlCase("map_Kd -clamp off c.png\n").material().base_colour_texture.wrap_s, Wrap::kRepeat);
}

TEST(ObjMaterial, ScaleAndOffsetOfTexturesTurnWithV) {
  const MtlCase c("map_Kd -s 2 4 -o 0.125 0.25 c.png\n");
  const UvTransform& t = c.material().base_colour_texture.transform;
  // (u, v) -> (2u + 1/8, 4v + 1/4) with v upwards.
  for (const Vec2f obj : {Vec2f{0, 0}, Vec2f{0.5f, 0.25f}, Vec2f{1, 1}}) {
    const float u = t.offset.x + t.scale.x * obj.x, v = t.offset.y + t.scale.y * (1 - obj.y);
    EXPECT_FLOAT_EQ(u, 2 * obj.x + 0.125f);
    EXPECT_FLOAT_EQ(1 - v, 4 * obj.y + 0.25f);
  }
}

TEST(ObjMaterial, KdBesideMapKdFollowsTheOption) {
  EXPECT_EQ(MtlCase("Kd 0.5 0.5 0.5\nmap_Kd c.png\n").material().base_colour, (Vec4f{1, 1, 1, 1}));
  ImportOptions multiply;
  multiply.obj_kd = KdPolicy::kMultiply;
  EXPECT_NEAR(MtlCase("Kd 0.5 0.5 0.5\nmap_Kd c.png\n", multiply).material().base_colour.x, 0.21404, 1e-4);
  EXPECT_NEAR(MtlCase("Kd 0.5 0.25 1\n").material().base_colour.x, 0.21404, 1e-4)
      << "without a texture Kd is the colour";
}

TEST(ObjMaterial, TransparencyIsReadAsItsWriterMeantIt) {
  const MtlCase opaque("Tr 1.0\n");
  EXPECT_EQ(opaque.material().base_colour.w, 1) << "literally invisible; exporters mean opaque";
  EXPECT_EQ(opaque.material().alpha_mode, AlphaMode::kOpaque);
  EXPECT_EQ(count_notes(opaque.model, "transparency-read-as-opaque"), 1);
  const MtlCase meshlab("Tr 1.000000\n", {}, "# Converted by Meshlab Group\n");
  EXPECT_EQ(meshlab.material().alpha_mode, AlphaMode::kOpaque);
  EXPECT_EQ(count_notes(meshlab.model, "transparency-read-as-opaque"), 0) << "MeshLab's Tr is an opacity";
  EXPECT_FLOAT_EQ(MtlCase("Tr 0.25\n", {}, "# Converted by Meshlab Group\n").material().base_colour.w, 0.25f);
  const MtlCase quarter("Tr 0.25\n");
  EXPECT_FLOAT_EQ(quarter.material().base_colour.w, 0.75f);
  EXPECT_EQ(quarter.material().alpha_mode, AlphaMode::kBlend);
  EXPECT_FLOAT_EQ(MtlCase("Tr 1\nd 0.5\n").material().base_colour.w, 0.5f) << "d wins";
  EXPECT_EQ(count_notes(MtlCase("d 0\n").model, "invisible-material"), 1);
  EXPECT_EQ(MtlCase("d 1\n").material().alpha_mode, AlphaMode::kOpaque);
}

TEST(ObjMaterial, AlphaOfTextures) {
  EXPECT_EQ(MtlCase("map_Kd cutout.png\n").material().alpha_mode, AlphaMode::kMask);
  EXPECT_EQ(MtlCase("map_Kd glass.png\nmap_d glass.png\n").material().alpha_mode, AlphaMode::kBlend);
  EXPECT_EQ(MtlCase("map_Kd opaque.png\n").material().alpha_mode, AlphaMode::kOpaque);
  const MtlCase apart("map_Kd c.png\nmap_d height.png\n");
  EXPECT_EQ(apart.material().alpha_mode, AlphaMode::kBlend);
  ASSERT_EQ(apart.model.images.size(), 1u);
  const Image& both = apart.model.images[0];
  EXPECT_EQ(both.channels, 4);
  const MtlCase colour("map_Kd c.png\n"), height("map_Kd height.png\n");
  const Pixels c = decode_image(colour.model.images[0]), h = decode_image(height.model.images[0]);
  const Pixels p = decode_image(both);
  EXPECT_EQ(p.width_px, std::max(c.width_px, h.width_px));
  EXPECT_EQ(p.at(0, 0)[0], c.at(0, 0)[0]);
  EXPECT_EQ(p.at(0, 0)[3], h.at(0, 0)[0]);
  EXPECT_EQ(count_notes(MtlCase("map_Kd c.png\nmap_d -s 2 2 1 height.png\n").model, "separate-alpha-map"), 1);
}

TEST(ObjMaterial, RoughnessAndMetallicMapsBecomeOneImage) {
  const MtlCase both("Pr 0.5\nmap_Pr height.png\nmap_Pm c.png\n");
  ASSERT_EQ(both.model.images.size(), 1u);
  EXPECT_TRUE(both.material().metallic_roughness_texture.used());
  EXPECT_EQ(both.material().roughness, 1);
  EXPECT_EQ(both.material().metallic, 1);
  const MtlCase colour("map_Kd c.png\n"), height("map_Kd height.png\n");
  const Pixels p = decode_image(both.model.images[0]);
  EXPECT_EQ(p.at(0, 0)[1], decode_image(height.model.images[0]).at(0, 0)[0]);
  EXPECT_EQ(p.at(0, 0)[2], decode_image(colour.model.images[0]).at(0, 0)[0]);
  const MtlCase rough("Pm 0\nmap_Pr height.png\n");
  EXPECT_EQ(rough.material().metallic, 0);
  EXPECT_EQ(decode_image(rough.model.images[0]).at(0, 0)[2], 255);
  EXPECT_EQ(count_notes(MtlCase("map_Ks c.png\ndisp height.png\n").model, "unsupported-map"), 2);
}

TEST(ObjMaterial, BumpIsANormalMapWhenItLooksLikeOne) {
  for (const char* line :
       {"map_Bump -bm 1.0 normal.png", "bump normal.png", "map_bump normal.png", "norm normal.png"}) {
    const MtlCase c(std::string(line) + "\n");
    EXPECT_TRUE(c.material().normal_texture.used()) << line;
    EXPECT_EQ(c.model.images.size(), 1u) << line;
    EXPECT_EQ(c.material().normal_scale, 1);
  }
  EXPECT_FLOAT_EQ(MtlCase("map_Bump -bm 0.5 normal.png\n").material().normal_scale, 0.5f);
  for (const char* image : {"height.png", "brown.png"}) {
    const MtlCase c(std::string("map_Bump ") + image + "\n");
    EXPECT_FALSE(c.material().normal_texture.used()) << image;
    EXPECT_EQ(count_notes(c.model, "height-map"), 1) << image;
    EXPECT_TRUE(c.model.images.empty()) << "unused images are gone";
  }
}

TEST(ObjMaterial, EmissionAndPbr) {
  const MtlCase c("Ke 0 0 0\nmap_Ke c.png\nPr 0.25\nPm 2\n");
  EXPECT_EQ(c.material().emissive, (Vec3f{1, 1, 1}));
  EXPECT_TRUE(c.material().emissive_texture.used());
  EXPECT_FLOAT_EQ(c.material().roughness, 0.25f);
  EXPECT_EQ(c.material().metallic, 1);
  const MtlCase plain("Kd x y z\n");
  EXPECT_EQ(plain.material().metallic, 0);
  EXPECT_EQ(count_notes(plain.model, "odd-material"), 1);
}

}  // namespace texmesh::obj_material_test
