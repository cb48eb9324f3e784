#include <chrono>
#include <cmath>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "stages/image/decode_image.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"

namespace texmesh {
namespace {

using testing::bytes_of;
using testing::count_notes;
using testing::input_error;
using testing::MemoryResolver;

Model import(const std::string& text, Resolver& resolver, const ImportOptions& options = {}) {
  return import_obj("a.obj", bytes_of(text), resolver, options, {}).model;
}
Model import(const std::string& text) {
  MemoryResolver resolver;
  return import(text, resolver);
}

const std::string kVertices = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
const std::string kTextured = "mtllib a.mtl\n" + kVertices + "usemtl m\nf 1/1 2/2 3/3 4/4\n";

Bytes filled_png(int channels, const Bytes& texel) {
  Bytes samples;
  for (int i = 0; i < 64; ++i) samples.insert(samples.end(), texel.begin(), texel.end());
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:UnassociatedAlpha", 1);
  return testing::encode_image("png", 8, 8, channels, samples, OIIO::TypeDesc::UINT8, attributes);
}

// The model of kTextured with `mtl` behind "newmtl m" and pictures to refer to.
struct MtlCase {
  MemoryResolver resolver;
  Model model;
  explicit MtlCase(const std::string& mtl, const ImportOptions& options = {},
                   const std::string& before = "") {
    resolver.files["a.mtl"] = bytes_of(before + "newmtl m\n" + mtl);
    resolver.files["c.png"] = testing::png_bytes(8, 8, 3);
    resolver.files["a b.png"] = testing::png_bytes(8, 4, 3);
    resolver.files["normal.png"] = filled_png(3, {127, 130, 250});
    resolver.files["height.png"] = filled_png(1, {90});
    resolver.files["brown.png"] = filled_png(3, {120, 90, 60});
    resolver.files["cutout.png"] = [] {
      Bytes samples;
      for (int i = 0; i < 64; ++i)
        samples.insert(samples.end(), {10, 200, 30, static_cast<std::uint8_t>(i % 2 ? 255 : 0)});
      OIIO::ImageSpec attributes;
      attributes.attribute("oiio:UnassociatedAlpha", 1);
      return testing::encode_image("png", 8, 8, 4, samples, OIIO::TypeDesc::UINT8, attributes);
    }();
    resolver.files["glass.png"] = filled_png(4, {9, 9, 9, 100});
    resolver.files["opaque.png"] = filled_png(4, {9, 9, 9, 255});
    model = import(kTextured, resolver, options);
  }
  const Material& material() const { return model.materials.at(0); }
  std::string image_name() const {
    const TextureRef& ref = material().base_colour_texture;
    return ref.used() ? model.images.at(static_cast<std::size_t>(ref.image)).name : "none";
  }
};

TEST(ImportObj, QuadWithTextureCoordinates) {
  const Model m = import(kVertices + "f 1/1 2/2 3/3 4/4\n");
  EXPECT_EQ(m.mesh.positions.size(), 4u);
  EXPECT_EQ(m.mesh.triangles.size(), 2u);
  EXPECT_EQ(m.mesh.uv0[0], (Vec2f{0, 1})) << "v grows downwards in glTF";
  EXPECT_EQ(m.mesh.uv0[2], (Vec2f{1, 0}));
  EXPECT_TRUE(m.notes.empty());
}

TEST(ImportObj, NegativeIndicesAndMixedCorners) {
  EXPECT_EQ(import(kVertices + "f -4/-4 -3/-3 -2/-2 -1/-1\n").mesh,
            import(kVertices + "f 1/1 2/2 3/3 4/4\n").mesh);
  const Model m = import(kVertices + "vn 0 0 2\nf 1//1 2//-1 3//1\nf 1/1/1 3/3/1 4/4/1\nf 1 2 4\n");
  EXPECT_EQ(m.mesh.triangles.size(), 3u);
  EXPECT_EQ(m.mesh.normals[0], (Vec3f{0, 0, 1}));
  EXPECT_EQ(import("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").mesh.triangles.size(), 1u)
      << "faces before their vertices";
}

TEST(ImportObj, CommentsContinuationsAndLineEnds) {
  const Mesh expected = import(kVertices + "f 1 2 3\n").mesh;
  EXPECT_EQ(import("\xef\xbb\xbf# c\r\n" + kVertices + "  f 1 2 \\\n 3 # a comment\n").mesh, expected);
  std::string mac = kVertices + "f 1 2 3\n";
  for (char& c : mac) c = c == '\n' ? '\r' : c;
  EXPECT_EQ(import(mac).mesh, expected);
  EXPECT_EQ(import(kVertices + "s off\ncstype bezier\nl 1 2\np 1\nf 1 2 3\n").mesh, expected);
  EXPECT_EQ(count_notes(import(kVertices + "l 1 2\np 1\nf 1 2 3\n"), "lines-and-points"), 1);
  EXPECT_EQ(count_notes(import(kVertices + "f 1 2\nf 1 2 3\n"), "face-without-area"), 1);
}

TEST(ImportObj, ConcavePolygonsStayInsideThemselves) {
  // An L of six corners, area 3; a fan from its first corner would cover the notch.
  for (int start = 0; start < 6; ++start) {
    const int xs[] = {0, 2, 2, 1, 1, 0}, ys[] = {0, 0, 1, 1, 2, 2};
    std::string text;
    for (int i = 0; i < 6; ++i) text += "v " + std::to_string(xs[i]) + " " + std::to_string(ys[i]) + " 3\n";
    text += "f";
    for (int i = 0; i < 6; ++i) text += " " + std::to_string((start + i) % 6 + 1);
    const Mesh mesh = import(text + "\n").mesh;
    EXPECT_EQ(mesh.triangles.size(), 4u);
    double area = 0;
    for (const Triangle& t : mesh.triangles) {
      const Vec3f n =
          cross(mesh.positions[mesh.wedge_position[t[1]]] - mesh.positions[mesh.wedge_position[t[0]]],
                mesh.positions[mesh.wedge_position[t[2]]] - mesh.positions[mesh.wedge_position[t[0]]]);
      EXPECT_GT(n.z, 0);
      area += n.z / 2;
    }
    EXPECT_NEAR(area, 3, 1e-6);
  }
  // An arrow head: only one diagonal of the quad lies inside.
  const Mesh arrow = import("v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf 1 2 3 4\n").mesh;
  for (const Triangle& t : arrow.triangles)
    EXPECT_GT(
        cross(arrow.positions[t[1]] - arrow.positions[t[0]], arrow.positions[t[2]] - arrow.positions[t[0]]).z,
        0);
}

TEST(ImportObj, PolygonsOfManyCorners) {
  std::string text, face = "f";
  for (int i = 0; i < 5000; ++i) {
    const double a = i * 6.283185307 / 5000, r = i % 2 ? 1 : 0.7;
    text += "v " + std::to_string(r * std::cos(a)) + " " + std::to_string(r * std::sin(a)) + " 0\n";
    face += " " + std::to_string(i + 1);
  }
  EXPECT_EQ(import(text + face + "\n").mesh.triangles.size(), 4998u);
}

TEST(ImportObj, IndicesOutOfRangeAreErrorsWithTheirLine) {
  for (const char* f :
       {"1 2 5", "1 2 0", "1 2 -5", "1/5 2/1 3/1", "1/-5 2/1 3/1", "1//1 2//1 3//1", "1 2 99999999999",
        "1 2 2147483648", "1 2 -9223372036854775808", "1 2 x", "1 2 3/x", "1 2 /3", "1 2 1.5"}) {
    const std::string error = input_error([&] { import(kVertices + "f " + f + "\n"); });
    EXPECT_NE(error.find("a.obj: line 9"), std::string::npos) << f << ": " << error;
  }
}

TEST(ImportObj, NumbersThatAreNoneAreErrorsAndNanIsNot) {
  for (const char* v : {"v 1 2", "v 1 two 3", "v", "vt", "vt x", "vn 1 2", "v 1,5 2 3"})
    EXPECT_NE(input_error([&] { import(kVertices + v + "\nf 1 2 3\n"); }).find("line 9"), std::string::npos)
        << v;
  for (const char* v : {"nan 0 0", "0 -nan(ind) 0", "0 0 1.#QNAN", "inf 0 0", "1e999 0 0"}) {
    const Model m = import(kVertices + "v " + v + "\nf 1 2 3\nf 1 2 5\n");
    EXPECT_EQ(m.mesh.triangles.size(), 1u) << v;
    EXPECT_EQ(count_notes(m, "non-finite-position"), 1) << v;
  }
  EXPECT_THROW(import("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), InputError);
  const Model uv = import(kVertices + "vt nan 3\nf 1/5 2/2 3/3\n");
  EXPECT_EQ(count_notes(uv, "non-finite-uv"), 1);
  EXPECT_EQ(uv.mesh.uv0[0], (Vec2f{0, 0}));
}

TEST(ImportObj, EmptyAndFaceless) {
  EXPECT_THROW(import(""), InputError);
  EXPECT_THROW(import("hello\n"), InputError);
  EXPECT_THROW(import(kVertices), InputError);
  EXPECT_THROW(import(std::string("\0\1\2\3", 4)), InputError);
}

TEST(ImportObj, FarAwayScansKeepTheirMillimetres) {
  const Model m = import(
      "v 5000000.001 4000000.002 100.003\nv 5000001.001 4000000.002 100.003\nv 5000000.001 4000001.002 "
      "100.003\nf 1 2 3\n");
  EXPECT_NE(m.mesh.origin.x, 0);
  const Vec3d p = to_double(m.mesh.positions[0]) + m.mesh.origin;
  EXPECT_NEAR(p.x, 5000000.001, 1e-7);
  EXPECT_NEAR(p.y, 4000000.002, 1e-7);
  EXPECT_NEAR(p.z, 100.003, 1e-7);
}

TEST(ImportObj, PartsAndMaterials) {
  const Model m =
      import(kVertices + "o one\nusemtl red wood\nf 1 2 3\ng two\nusemtl b\nf 1 3 4\no three\nf 2 3 4\n");
  EXPECT_EQ(m.mesh.part_names, (std::vector<std::string>{"one", "one/two", "three"}));
  EXPECT_EQ(m.mesh.triangle_part, (std::vector<std::uint16_t>{0, 1, 2}));
  EXPECT_EQ(m.mesh.triangle_material, (std::vector<std::uint16_t>{0, 1, 1}));
  EXPECT_EQ(m.materials[0].name, "red wood");
  EXPECT_EQ(count_notes(m, "missing-material"), 2) << "usemtl without mtllib";
}

TEST(ImportObj, MissingMtlAndMissingTextureAreWarnings) {
  Model m = import(kTextured);
  EXPECT_EQ(count_notes(m, "missing-mtl"), 1);
  EXPECT_EQ(m.materials[0].name, "m");
  EXPECT_FALSE(m.materials[0].base_colour_texture.used());
  const MtlCase gone("Kd 0.5 0 0\nmap_Kd gone.png\n");
  EXPECT_EQ(count_notes(gone.model, "missing-texture"), 1);
  EXPECT_NEAR(gone.material().base_colour.x, 0.21404, 1e-4) << "then Kd is the colour";
  EXPECT_EQ(gone.material().base_colour.y, 0);
}

TEST(ImportObj, LibrariesWithBlanksAndSeveralInOneLine) {
  MemoryResolver resolver;
  resolver.files["my scan.mtl"] = bytes_of("newmtl m\nKd 1 0 0\n");
  EXPECT_EQ(
      import("mtllib my scan.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n", resolver).materials[0].base_colour.y,
      0);
  resolver.files = {{"x.mtl", bytes_of("newmtl other\n")}, {"y.mtl", bytes_of("newmtl m\nKd 0 1 0\n")}};
  EXPECT_EQ(
      import("mtllib x.mtl y.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n", resolver).materials[0].base_colour.x,
      0);
  const Model half = import("mtllib x.mtl gone.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n", resolver);
  EXPECT_EQ(count_notes(half, "missing-mtl"), 1);
  EXPECT_EQ(count_notes(half, "missing-material"), 1);
}

TEST(ImportObj, TextureNamesWithBlanksOptionsAndTrailingBlanks) {
  for (const char* line : {"map_Kd a b.png", "map_Kd   a b.png \t", "map_Kd -s 1 1 1 -o 0 0 0 a b.png",
                           "map_Kd -clamp on a b.png", "map_Kd -blendu on -mm 0 1 -texres 512 a b.png\r",
                           "map_Kd \"a b.png\"", "map_Ka a b.png", "MAP_KD a b.png"})
    EXPECT_EQ(MtlCase(std::string(line) + "\n").image_name(), "a b.png") << line;
  EXPECT_EQ(MtlCase("map_Kd .\\c.png\n").resolver.asked.back(), "./c.png");
  EXPECT_EQ(MtlCase("map_Kd -clamp on c.png\n").material().base_colour_texture.wrap_s, Wrap::kClamp);
  EXPECT_EQ(MtlCase("map_Kd -clamp off c.png\n").material().base_colour_texture.wrap_s, Wrap::kRepeat);
}

TEST(ImportObj, ScaleAndOffsetOfTexturesTurnWithV) {
  const MtlCase c("map_Kd -s 2 4 -o 0.125 0.25 c.png\n");
  const UvTransform& t = c.material().base_colour_texture.transform;
  // (u, v) -> (2u + 1/8, 4v + 1/4) with v upwards.
  for (const Vec2f obj : {Vec2f{0, 0}, Vec2f{0.5f, 0.25f}, Vec2f{1, 1}}) {
    const float u = t.offset.x + t.scale.x * obj.x, v = t.offset.y + t.scale.y * (1 - obj.y);
    EXPECT_FLOAT_EQ(u, 2 * obj.x + 0.125f);
    EXPECT_FLOAT_EQ(1 - v, 4 * obj.y + 0.25f);
  }
}

TEST(ImportObj, KdBesideMapKdFollowsTheOption) {
  EXPECT_EQ(MtlCase("Kd 0.5 0.5 0.5\nmap_Kd c.png\n").material().base_colour, (Vec4f{1, 1, 1, 1}));
  ImportOptions multiply;
  multiply.obj_kd = KdPolicy::kMultiply;
  EXPECT_NEAR(MtlCase("Kd 0.5 0.5 0.5\nmap_Kd c.png\n", multiply).material().base_colour.x, 0.21404, 1e-4);
  EXPECT_NEAR(MtlCase("Kd 0.5 0.25 1\n").material().base_colour.x, 0.21404, 1e-4)
      << "without a texture Kd is the colour";
}

TEST(ImportObj, TransparencyIsReadAsItsWriterMeantIt) {
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

TEST(ImportObj, AlphaOfTextures) {
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

TEST(ImportObj, RoughnessAndMetallicMapsBecomeOneImage) {
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

TEST(ImportObj, BumpIsANormalMapWhenItLooksLikeOne) {
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

TEST(ImportObj, EmissionAndPbr) {
  const MtlCase c("Ke 0 0 0\nmap_Ke c.png\nPr 0.25\nPm 2\n");
  EXPECT_EQ(c.material().emissive, (Vec3f{1, 1, 1}));
  EXPECT_TRUE(c.material().emissive_texture.used());
  EXPECT_FLOAT_EQ(c.material().roughness, 0.25f);
  EXPECT_EQ(c.material().metallic, 1);
  const MtlCase plain("Kd x y z\n");
  EXPECT_EQ(plain.material().metallic, 0);
  EXPECT_EQ(count_notes(plain.model, "odd-material"), 1);
}

TEST(ImportObj, NamesThatLeaveTheFolderAreRefused) {
  for (const char* name :
       {"../c.png", "/etc/c.png", "C:\\c.png", "http://x/c.png", "file:c.png", "a/../../c.png", "..\\c.png"})
    EXPECT_THROW(MtlCase(std::string("map_Kd ") + name + "\n"), InputError) << name;
  EXPECT_THROW(import("mtllib ../a.mtl\n" + kVertices + "f 1 2 3\n"), InputError);
}

TEST(ImportObj, ForeignContentIsRefusedAndForeignNamesAreNoted) {
  MemoryResolver resolver;
  resolver.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd t.jpg\n");
  resolver.files["t.jpg"] = testing::png_bytes(8, 8, 3);
  const Model m = import(kTextured, resolver);
  EXPECT_EQ(m.images[0].format, ImageFormat::kPng);
  EXPECT_EQ(count_notes(m, "image-extension"), 1);
  resolver.files["t.jpg"] = bytes_of("P6\n1 1\n255\nabc");
  EXPECT_NE(input_error([&] { import(kTextured, resolver); }).find("t.jpg"), std::string::npos);
}

TEST(ImportObj, VertexColours) {
  const std::string colours = "v 0 0 0 1 0 0.5\nv 1 0 0 1 0 0.5\nv 0 1 0\n";
  Model m = import(colours + "f 1 2 3\n");
  ASSERT_EQ(m.mesh.colours.size(), 3u);
  EXPECT_NEAR(m.mesh.colours[0].z, 0.21404, 1e-4);
  EXPECT_EQ(m.mesh.colours[2], (Vec4f{1, 1, 1, 1}));
  m = import("v 0 0 0 255 0 128\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
  EXPECT_NEAR(m.mesh.colours[0].z, 0.21586, 1e-4) << "0..255";
  EXPECT_TRUE(import("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").mesh.colours.empty()) << "w is no colour";
  MemoryResolver resolver;
  resolver.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd c.png\nnewmtl k\nKd 0.8 0.8 0.8\n");
  resolver.files["c.png"] = testing::png_bytes(8, 8, 3);
  m = import("mtllib a.mtl\n" + colours + "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n", resolver);
  EXPECT_TRUE(m.mesh.colours.empty());
  EXPECT_EQ(count_notes(m, "colours-beside-texture"), 1);
  m = import("mtllib a.mtl\n" + colours + "usemtl k\nf 1 2 3\n", resolver);
  EXPECT_EQ(m.materials[0].base_colour, (Vec4f{1, 1, 1, 1})) << "the colours are the colour";
}

TEST(ImportObj, HugeUvRangesStay) {
  const Model m = import("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt -721.25 1553.5\nvt 0 0\nvt 1 0\nf 1/1 2/2 3/3\n");
  EXPECT_EQ(m.mesh.uv0[0], (Vec2f{-721.25f, -1552.5f}));
}

TEST(ImportObj, Limits) {
  MemoryResolver resolver;
  ImportOptions options;
  options.max_vertices = 3;
  EXPECT_THROW(import(kVertices + "f 1 2 3\n", resolver, options), InputError);
  options = {};
  options.max_triangles = 1;
  EXPECT_THROW(import(kVertices + "f 1 2 3 4\n", resolver, options), InputError);
  options = {};
  options.max_images = 0;
  EXPECT_THROW(MtlCase("map_Kd c.png\n", options), InputError);
}

TEST(ImportObj, TruncatedAtAnyLengthNeverHarms) {
  MemoryResolver resolver;
  resolver.files["a.mtl"] = bytes_of("newmtl m\nKd 1 0 0\nmap_Kd -s 1 1 c.png\nd 0.5\n");
  resolver.files["c.png"] = testing::png_bytes(4, 4, 3);
  const Bytes mtl = resolver.files["a.mtl"];
  for (std::size_t n = 0; n < kTextured.size(); ++n) try {
      EXPECT_LE(import(kTextured.substr(0, n), resolver).mesh.triangles.size(), 2u);
    } catch (const InputError&) {
    }
  for (std::size_t n = 0; n < mtl.size(); ++n) {
    resolver.files["a.mtl"] = {mtl.begin(), mtl.begin() + static_cast<std::ptrdiff_t>(n)};
    EXPECT_EQ(import(kTextured, resolver).mesh.triangles.size(), 2u);
  }
  for (std::size_t i = 0; i < kTextured.size(); ++i)
    for (int bit : {0, 2, 4, 7}) {
      std::string text = kTextured;
      text[i] = static_cast<char>(text[i] ^ 1 << bit);
      try {
        import(text, resolver);
      } catch (const InputError&) {
      }
    }
}

TEST(ImportObj, TheSameModelEveryTime) {
  EXPECT_EQ(MtlCase("map_Kd c.png\n").model, MtlCase("map_Kd c.png\n").model);
}

// 200,000 triangles; the linear time that they take here is reported, and a quadratic reader would not end.
TEST(ImportObj, LargeFilesTakeLinearTime) {
  const int n = 316;
  std::string text;
  for (int j = 0; j <= n; ++j)
    for (int i = 0; i <= n; ++i) {
      text += "v " + std::to_string(i * 0.01) + " " + std::to_string(j * 0.01) + " " +
              std::to_string(i * j * 1e-6) + "\nvt " + std::to_string(static_cast<double>(i) / n) + " " +
              std::to_string(static_cast<double>(j) / n) + "\n";
    }
  for (int j = 0; j < n; ++j)
    for (int i = 0; i < n; ++i) {
      const int a = j * (n + 1) + i + 1;
      for (const auto& t : {std::array{a, a + 1, a + n + 2}, {a, a + n + 2, a + n + 1}}) {
        text += "f";
        for (int k : t) text += " " + std::to_string(k) + "/" + std::to_string(k);
        text += "\n";
      }
    }
  const auto start = std::chrono::steady_clock::now();
  EXPECT_EQ(import(text).mesh.triangles.size(), 2u * n * n);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LT(seconds, 20);
}

}  // namespace
}  // namespace texmesh
