// What readers leave out is told; what files are, where their names say something else; texts in any
// encoding.
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "pipeline/import/import_images.h"
#include "pipeline/import/named_files.h"
#include "stages/image/decode_image.h"
#include "tests/pipeline/import/gltf/textured_gltf.h"
#include "tests/pipeline/import/obj/obj_cases.h"

namespace texmesh::lost_test {

using testing::bytes_of;
using testing::kTextured;
using testing::kVertices;
using testing::MemoryResolver;

ImportedModel import(const std::string& name, const Bytes& bytes, Resolver& files) {
  return import_model(name, bytes, files, {}, {});
}
ImportedModel import(const std::string& name, const std::string& text) {
  MemoryResolver files;
  return import(name, bytes_of(text), files);
}
/// The text of the one note that says what is lost; "" = none.
std::string lost(const ImportedModel& m) {
  std::string text;
  for (const Note& n : m.model.notes)
    if (n.code == kLostNote) {
      EXPECT_EQ(text, "") << "one line";
      EXPECT_EQ(n.severity, Severity::kInfo);
      text = n.text;
    }
  const auto source = nlohmann::json::parse(m.about.source);
  EXPECT_EQ(source.contains("lost"), !text.empty()) << m.about.source;
  return text;
}

const std::string kPlyHead = "ply\nformat ascii 1.0\n";
const std::string kPlyVertices = "element vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
const std::string kPlyFace = "element face 1\nproperty list uchar int vertex_indices\n";
const std::string kPlyRows = "0 0 0\n1 0 0\n0 1 0\n3 0 1 2\n";

TEST(Lost, NothingIsSaidOfModelsThatLoseNothing) {
  EXPECT_EQ(lost(import("m.obj", "# scan\no a\ng b\ns 1\n" + kVertices + "f 1/1 2/2 3/3\n")), "");
  EXPECT_EQ(lost(import("m.ply", kPlyHead + kPlyVertices + kPlyFace + "end_header\n" + kPlyRows)), "");
  EXPECT_EQ(lost(import("m.stl",
                        "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
                        "endloop\nendfacet\nendsolid a\n")),
            "");
  MemoryResolver files;
  EXPECT_EQ(lost(import("m.glb", testing::quad().glb(), files)), "");
}

TEST(Lost, StatementsAndElementsOfObj) {
  EXPECT_EQ(
      lost(import("m.obj", kVertices + "vp 1 2\nVP 1 2\nsurf 0 1 0 1 1 2 3\nl 1 2\np 1\nf 1 2 3\n")),
      "2 line and point elements, 1 statements \"surf\", 2 statements \"vp\" of the source are not in the package");
  MemoryResolver files;
  files.files["a.mtl"] = bytes_of("newmtl m\nKa 0 0 0\nKd 1 1 1\nNs 2\nillum 2\nfoo 1\nFOO 2\n");
  EXPECT_EQ(lost(import("m.obj", bytes_of(kTextured), files)),
            "2 statements \"foo\" of materials of the source are not in the package");
  std::string many = kVertices + "f 1 2 3\n";
  for (int i = 0; i < 1000; ++i) many += "x" + std::to_string(i) + " 1\n";
  EXPECT_LT(import("m.obj", many).about.source.size(), 4000u) << "bounded";
}

TEST(Lost, ElementsAndValuesOfPly) {
  EXPECT_EQ(
      lost(import("m.ply",
                  kPlyHead + kPlyVertices + "property float confidence\n" + kPlyFace +
                      "property int flags\nelement edge 2\nproperty int vertex1\nproperty int vertex2\n"
                      "end_header\n0 0 0 1\n1 0 0 1\n0 1 0 1\n3 0 1 2 7\n0 1\n1 2\n")),
      "2 elements \"edge\", 3 values \"confidence\" of vertex, 1 values \"flags\" of face of the source are not "
      "in the package");
}

TEST(Lost, WhatGltfHasMore) {
  testing::GltfBuilder b = testing::quad();
  b.json["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", 1}, {"znear", 1}}}}};
  b.json["animations"] = nlohmann::json::array({nlohmann::json::object(), nlohmann::json::object()});
  b.json["extensionsUsed"] = {"KHR_materials_variants", "EXT_odd"};
  b.json["extensions"] = {
      {"KHR_materials_variants", {{"variants", {{{"name", "red"}}, {{"name", "blue"}}}}}}};
  auto& primitive = b.json["meshes"][0]["primitives"][0];
  primitive["attributes"]["_TEMPERATURE"] = primitive["attributes"]["POSITION"];
  primitive["targets"] = {{{"POSITION", 0}}};
  MemoryResolver files;
  EXPECT_EQ(
      lost(import("m.glb", b.glb(), files)),
      "2 animations, 1 attributes \"_TEMPERATURE\", 1 cameras, 1 extension \"EXT_odd\", 2 material variants, 1 "
      "morph targets of the source are not in the package");
}

TEST(Lost, ColoursOfStl) {
  Bytes stl(84 + 50);
  stl[80] = 1;
  const float corners[9] = {0, 0, 0, 1, 0, 0, 0, 1, 0};
  std::memcpy(stl.data() + 96, corners, sizeof corners);
  MemoryResolver files;
  EXPECT_EQ(lost(import("m.stl", stl, files)), "");
  stl[132] = 7;
  EXPECT_NE(lost(import("m.stl", stl, files)), "");
}

TEST(Artec, BothElementsTextureTheFaces) {
  const std::string artec =
      "element vertex 4\nproperty float x\nproperty float y\nproperty float z\n"
      "element face 2\nproperty list uchar int vertex_indices\n"
      "element multi_texture_vertex 6\nproperty uchar tx\nproperty float u\nproperty float v\n"
      "element multi_texture_face 2\nproperty uchar tx\nproperty uint tn\n"
      "property list uchar int texture_vertex_indices\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2\n3 0 2 3\n"
      "0 0 0\n0 1 0\n0 1 1\n1 0 0\n1 0.5 1\n1 0.25 0.75\n"
      "0 3 3 0 1 2\n1 3 3 3 4 5\n";
  for (const std::string comments : {"comment TextureFile s_0.jpg\ncomment TextureFile s_1.png\n", ""}) {
    MemoryResolver files;
    files.files["s_0.jpg"] = testing::png_bytes(8, 8, 3);
    files.files["s_1.png"] = testing::png_bytes(4, 8, 3);
    const ImportedModel m = import("s.ply", bytes_of("ply\nformat ascii 1.0\n" + comments + artec), files);
    ASSERT_EQ(m.model.images.size(), 2u) << comments;
    ASSERT_EQ(m.model.materials.size(), 2u);
    const Mesh& mesh = m.model.mesh;
    EXPECT_EQ(m.model
                  .images[static_cast<std::size_t>(
                      m.model.materials[mesh.triangle_material[1]].base_colour_texture.image)]
                  .width_px,
              4u);
    EXPECT_EQ(mesh.uv0[mesh.triangles[1][2]], (Vec2f{0.25f, 0.25f}));
    EXPECT_EQ(mesh.uv0[mesh.triangles[0][1]], (Vec2f{1, 1}));
    EXPECT_EQ(lost(m), "");
    EXPECT_EQ(testing::count_notes(m.model, "missing-texture"), 0);
  }
  EXPECT_EQ(testing::count_notes(import("s.ply", "ply\nformat ascii 1.0\n" + artec).model, "missing-texture"),
            2);
  MemoryResolver files;
  files.files["s_0.jpg"] = files.files["s_1.jpg"] = testing::png_bytes(8, 8, 3);
  EXPECT_EQ(import("s-small_2.ply", bytes_of("ply\nformat ascii 1.0\n" + artec), files).model.images.size(),
            1u);
  std::string wrong = artec;
  wrong.replace(wrong.find("1 3 3 3 4 5"), 11, "1 3 3 3 4 9");
  EXPECT_EQ(
      testing::count_notes(import("s.ply", "ply\nformat ascii 1.0\n" + wrong).model, "odd-texcoord-list"), 1);
}

TEST(Obj, ZbrushColoursAreThoseOfVertices) {
  const ImportedModel m = import("z.obj",
                                 "#MRGB ffff0000ff00ff00\n#MRGB ff0000ffffffffff\nv 0 0 0\nv 1 0 0\nv 1 1 0\n"
                                 "v 0 1 0\nf 1 2 3 4\n");
  ASSERT_EQ(m.model.mesh.colours.size(), 4u);
  EXPECT_EQ(m.model.mesh.colours[0], (Vec4f{1, 0, 0, 1}));
  EXPECT_EQ(m.model.mesh.colours[2], (Vec4f{0, 0, 1, 1}));
  EXPECT_NE(lost(import("z.obj", "#MRGB ffff0000\n" + kVertices + "f 1 2 3\n")), "") << "too few";
  EXPECT_NE(lost(import("z.obj", "#MRGB ffff00zz\n#MRGB ffff0000\n" + kVertices + "f 1 2 3\n")), "");
}

TEST(Obj, SmoothingOffHoldsWhereThereAreNoNormals) {
  const std::string two = "f 1 2 3\nf 1 3 5\n", vertices = kVertices + "v 0 0 1\n";
  EXPECT_FALSE(import("s.obj", vertices + two).normals_by_specification);
  EXPECT_FALSE(import("s.obj", vertices + "s 1\n" + two).normals_by_specification);
  for (const std::string off : {"s off\n", "s 0\n", "S OFF\n"}) {
    const ImportedModel all = import("s.obj", vertices + off + two);
    EXPECT_TRUE(all.normals_by_specification) << off;
    EXPECT_TRUE(all.model.mesh.normals.empty());
  }
  const ImportedModel some = import("s.obj", vertices + "f 1 2 3\ns off\nf 1 3 5\n");
  EXPECT_FALSE(some.normals_by_specification);
  ASSERT_FALSE(some.model.mesh.normals.empty());
  const Mesh& mesh = some.model.mesh;
  for (int k = 0; k < 3; ++k) {
    EXPECT_NEAR(mesh.normals[mesh.triangles[0][static_cast<std::size_t>(k)]].z, 1, 1e-6);
    EXPECT_NEAR(mesh.normals[mesh.triangles[1][static_cast<std::size_t>(k)]].z, 0, 1e-6);
  }
  EXPECT_FALSE(import("s.obj", vertices + "vn 0 0 1\ns off\nf 1//1 2//1 3//1\n").normals_by_specification);
}

TEST(Obj, IndexZeroOfNormalsAndTextureCoordinatesIsNone) {
  for (const std::string face :
       {"f 1/1/0 2/2/0 3/3/0", "f 1//0 2//0 3//0", "f 1/0 2/0 3/0", "f 1/0/1 2/0/1 3/0/1"}) {
    const ImportedModel m = import("n.obj", kVertices + "vn 0 0 1\n" + face + "\n");
    EXPECT_EQ(m.model.mesh.triangles.size(), 1u);
    EXPECT_EQ(testing::count_notes(m.model, "index-0"), 1) << face;
  }
  EXPECT_THROW(import("n.obj", kVertices + "f 0 1 2\n"), InputError);
}

TEST(Obj, UdimTilesAreMaterials) {
  MemoryResolver files;
  files.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd skin.<UDIM>.png\n");
  files.files["skin.1001.png"] = testing::png_bytes(8, 8, 3);
  files.files["skin.1002.png"] = testing::png_bytes(4, 8, 3);
  files.files["skin.1011.png"] = testing::png_bytes(2, 8, 3);
  const ImportedModel m = import(
      "u.obj",
      bytes_of(
          "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nvt 2 0\nvt 1 1\nvt 0 2\nvt 1 2\n"
          "usemtl m\nf 1/1 2/2 3/3\nf 1/2 2/4 3/5\nf 1/3 2/5 3/6\n"),
      files);
  ASSERT_EQ(m.model.materials.size(), 3u);
  ASSERT_EQ(m.model.images.size(), 3u);
  for (const Vec2f& uv : m.model.mesh.uv0) {
    EXPECT_TRUE(uv.x >= 0 && uv.x <= 1 && uv.y >= 0 && uv.y <= 1) << uv.x << " " << uv.y;
  }
  const auto width_of = [&](std::size_t t) {
    const Material& material = m.model.materials[m.model.mesh.triangle_material[t]];
    return m.model.images[static_cast<std::size_t>(material.base_colour_texture.image)].width_px;
  };
  EXPECT_EQ(width_of(0), 8u);
  EXPECT_EQ(width_of(1), 4u);
  EXPECT_EQ(width_of(2), 2u);
}

const Note* note_of(const Notes& notes, const std::string& code) {
  const auto at = std::ranges::find(notes, code, &Note::code);
  return at == notes.end() ? nullptr : &*at;
}

TEST(Obj, MoreTilesThanMaterialsAreTold) {
  MemoryResolver files;
  files.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd skin.<UDIM>.png\n");
  std::string text = "mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt .5 .5\nvt 1.5 .5\nvt 2.5 .5\n";
  for (int k = 0; k < 65'532; ++k) text += "usemtl " + std::to_string(k) + "\nf 1/1 2/1 3/1\n";
  text += "usemtl m\n";
  const ImportedModel fits = import("t.obj", bytes_of(text + "f 1/1 2/1 3/1\n"), files);
  EXPECT_FALSE(note_of(fits.model.notes, "too-many-tiles"));
  const ImportedModel m =
      import("t.obj", bytes_of(text + "f 1/1 2/1 3/1\nf 1/2 2/2 3/2\nf 1/3 2/3 3/3\n"), files);
  const Note* told = note_of(m.model.notes, "too-many-tiles");
  ASSERT_TRUE(told);
  EXPECT_EQ(told->severity, Severity::kWarning);
  EXPECT_EQ(
      told->text,
      "faces lie in 3 UDIM tiles, and a model has at most 65535 materials: 2 tiles are shown without their own "
      "pictures. Join pictures, or compile parts of the model");
}

TEST(TiledImages, MoreTilesThanMaterialsAreTold) {
  MemoryResolver files;
  files.files["skin.1001.png"] = testing::png_bytes(8, 8, 3);
  Model model;
  TiledImages tiled;
  Material material;
  material.base_colour_texture.image =
      tiled.add_image(model, {"skin.<UDIM>.png", "", false}, files, "m.gltf", "/images/0", {});
  model.materials.assign(65'533, {});
  model.materials.push_back(material);
  Mesh& mesh = model.mesh;
  for (const float u : {0.5f, 1.5f, 2.5f}) {
    const auto at = static_cast<std::uint32_t>(mesh.uv0.size());
    mesh.uv0.resize(at + 3, {u, 0.5f});
    mesh.triangles.push_back({at, at + 1, at + 2});
    mesh.triangle_material.push_back(65'533);
  }
  tiled.split(model, files, "m.gltf", {});
  EXPECT_EQ(model.materials.size(), 65'535u);
  EXPECT_EQ(mesh.triangle_material, (std::vector<std::uint16_t>{65'533, 65'534, 65'533}));
  const Note* told = note_of(model.notes, "too-many-tiles");
  ASSERT_TRUE(told);
  EXPECT_NE(told->text.find("faces lie in 3 UDIM tiles"), std::string::npos);
  EXPECT_NE(told->text.find(": 1 tiles"), std::string::npos);
}

TEST(SourceText, EncodingsOfEveryTextFormat) {
  const std::string latin = "# author: Museum f\xfcr Kunst\no L\xf6we\n" + kVertices + "f 1 2 3\n";
  const ImportedModel obj = import("l.obj", latin);
  EXPECT_EQ(obj.about.creator, "Museum f\xc3\xbcr Kunst");
  EXPECT_EQ(obj.model.mesh.part_names[0], "L\xc3\xb6we");
  EXPECT_EQ(testing::count_notes(obj.model, "text-encoding"), 1);
  const ImportedModel ply = import("l.ply", kPlyHead + "comment author: M\xfcller \x80\n" + kPlyVertices +
                                                kPlyFace + "end_header\n" + kPlyRows);
  EXPECT_EQ(ply.about.creator, "M\xc3\xbcller \xe2\x82\xac");
  EXPECT_EQ(testing::count_notes(ply.model, "text-encoding"), 1);
  MemoryResolver files;
  files.files["a.mtl"] = bytes_of("newmtl B\xfcste\nmap_Kd M\xfcnze.png\n");
  files.files["M\xc3\xbcnze.png"] = testing::png_bytes(4, 4, 3);
  const ImportedModel both =
      import("b.obj", bytes_of("mtllib a.mtl\n" + kVertices + "usemtl B\xc3\xbcste\nf 1/1 2/2 3/3\n"), files);
  EXPECT_EQ(both.model.images.size(), 1u);
  std::string json = testing::quad().json.dump();
  testing::GltfBuilder b = testing::quad();
  b.json["nodes"][0]["name"] = "L@we";
  Bytes glb = b.glb();
  std::replace(glb.begin(), glb.end(), static_cast<std::uint8_t>('@'), std::uint8_t{0xf6});
  EXPECT_EQ(import("g.glb", glb, files).model.mesh.part_names[0], "L\xc3\xb6we");
}

TEST(SourceText, MarksAndUtf16AreNoPartOfTheText) {
  const std::string mtl = "newmtl m\nKd 1 0 0\n", obj = "mtllib a.mtl\n" + kVertices + "usemtl m\nf 1 2 3\n";
  const auto utf16 = [](const std::string& text, bool big) {
    std::string out = big ? "\xfe\xff" : "\xff\xfe";
    for (const char c : text) out += big ? std::string{'\0', c} : std::string{c, '\0'};
    return out;
  };
  for (const std::string& library : {mtl, "\xef\xbb\xbf" + mtl, utf16(mtl, false), utf16(mtl, true)})
    for (const std::string& model : {obj, "\xef\xbb\xbf" + obj, utf16(obj, false), utf16(obj, true)}) {
      MemoryResolver files;
      files.files["a.mtl"] = bytes_of(library);
      EXPECT_EQ(import("m.obj", bytes_of(model), files).model.materials.at(0).base_colour.y, 0);
    }
  MemoryResolver files;
  const Bytes gltf = testing::quad().gltf("data:application/octet-stream;base64,AAAA");
  const std::string text = "\xef\xbb\xbf{\"asset\":{\"version\":\"2.0\"}}";
  EXPECT_NE(testing::input_error([&] { import("m.gltf", bytes_of(text), files); }).find("triangle"),
            std::string::npos);
}

TEST(ForeignFile, IsNamedWhateverItsNameSays) {
  const std::string lfs = "version https://git-lfs.github.com/spec/v1\noid sha256:0\nsize 3\n";
  const std::vector<std::pair<std::string, std::string>> kinds{
      {lfs, "Git LFS pointer"},
      {"/annex/objects/SHA256E-s3--0\n", "git-annex pointer"},
      {"\n <!DOCTYPE html><html>", "HTML page"},
      {"<HTML><body>log in", "HTML page"},
      {std::string("PK\3\4\0\0", 6), "ZIP archive"},
      {"\x1f\x8b\x08", "gzip archive"},
      {"Kaydara FBX Binary  ", "FBX"},
      {"LASF1234", "point cloud"},
      {"<svg width=\"8\">", "SVG"},
      {"8BPS12345678", "Photoshop"},
      {std::string("\0\0\0\x18"
                   "ftypheic",
                   12),
       "HEIC"},
      {"b3dm12345678", "b3dmToGlb"},
      {"<?xml version=\"1.0\"?>", "XML"}};
  for (const auto& [content, what] : kinds) {
    for (const std::string name : {"m.glb", "m.gltf", "m.obj", "m.ply", "m.stl", "m.json", "m"})
      EXPECT_NE(testing::input_error([&, c = content] { import(name, c); }).find(what), std::string::npos)
          << name << what << testing::input_error([&, c = content] { import(name, c); });
    MemoryResolver files;
    files.files["c.png"] = bytes_of(content);
    files.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd c.png\n");
    for (const char* code : {"missing-texture", "missing-mtl"}) {
      const ImportedModel m = import("m.obj", bytes_of(kTextured), files);
      ASSERT_EQ(testing::count_notes(m.model, code), 1);
      EXPECT_NE(m.model.notes[0].text.find(what), std::string::npos);
      files.files["a.mtl"] = bytes_of(content);
    }
    files.files["b.bin"] = bytes_of(content);
    EXPECT_NE(
        testing::input_error([&] { import("m.gltf", testing::quad().gltf("b.bin"), files); }).find(what),
        std::string::npos);
    const Bytes scan = bytes_of(R"({"version":1,"type":"cylindrical-range-scan","y_step":1,"grid":"b.bin"})");
    EXPECT_NE(testing::input_error([&] { import("m.json", scan, files); }).find(what), std::string::npos);
  }
  EXPECT_NE(
      testing::input_error([] { import("m.obj", "v 0 0 0\nv 1 0 0\n"); }).find("point cloud of 2 points"),
      std::string::npos);
  EXPECT_NE(testing::input_error([] { import("m.xyz", "0 0 0\n"); }).find("point cloud"), std::string::npos);
  EXPECT_NE(testing::input_error([] { import("m.spz", "0 0 0\n"); }).find("splats"), std::string::npos);
  EXPECT_NE(testing::input_error([] {
              import("m.ply", kPlyHead + kPlyVertices +
                                  "property float f_dc_0\nproperty float scale_0\nend_header\n" +
                                  "0 0 0 1 1\n1 0 0 1 1\n0 1 0 1 1\n");
            }).find("Gaussian splats"),
            std::string::npos);
}

/// 8 x 8 texels; alpha is `inside` in the left half, `outside` in the right one.
Bytes half_png(std::uint8_t inside, std::uint8_t outside) {
  Bytes samples;
  for (int i = 0; i < 64; ++i) samples.insert(samples.end(), {200, 90, 30, i % 8 < 4 ? inside : outside});
  OIIO::ImageSpec attributes;
  attributes.attribute("oiio:UnassociatedAlpha", 1);
  return testing::encode_image("png", 8, 8, 4, samples, OIIO::TypeDesc::UINT8, attributes);
}

/// A quad whose texture coordinates are `u` in 0..1 of the picture, in each format.
std::vector<std::pair<std::string, Model>> quads(const Bytes& picture, double u0, double u1) {
  const std::string a = std::to_string(u0), b = std::to_string(u1);
  MemoryResolver files;
  files.files["t.png"] = picture;
  files.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd t.png\n");
  std::vector<std::pair<std::string, Model>> all;
  all.emplace_back(
      "obj", import("m.obj",
                    bytes_of("mtllib a.mtl\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nvt " + a + " 0\nvt " + b +
                             " 0\nvt " + b + " 1\nvt " + a + " 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n"),
                    files)
                 .model);
  all.emplace_back(
      "ply",
      import(
          "m.ply",
          bytes_of("ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 4\nproperty float x\n"
                   "property float y\nproperty float z\nproperty float s\nproperty float t\nelement face 1\n"
                   "property list uchar int vertex_indices\nend_header\n0 0 0 " +
                   a + " 0\n1 0 0 " + b + " 0\n1 1 0 " + b + " 1\n0 1 0 " + a + " 1\n4 0 1 2 3\n"),
          files)
          .model);
  return all;
}

TEST(SeenAlpha, OnlyTexelsThatFacesShowDecideInEveryFormat) {
  const auto expect_mode = [](const Bytes& picture, double u0, double u1, AlphaMode mode) {
    for (const auto& [format, model] : quads(picture, u0, u1))
      EXPECT_EQ(model.materials.at(0).alpha_mode, mode) << format << " " << u0 << " " << u1;
  };
  expect_mode(half_png(255, 0), 0, 0.5, AlphaMode::kOpaque);
  expect_mode(half_png(255, 0), 0, 1, AlphaMode::kMask);
  expect_mode(half_png(255, 0), 1, 1.5, AlphaMode::kOpaque);  // the picture repeats
  expect_mode(half_png(255, 0), -1, -0.5, AlphaMode::kOpaque);
  expect_mode(half_png(255, 0), 0, 900, AlphaMode::kMask);
  expect_mode(half_png(255, 100), 0, 0.5, AlphaMode::kOpaque);
  expect_mode(half_png(255, 100), 0, 1, AlphaMode::kBlend);
  expect_mode(half_png(255, 255), 0, 1, AlphaMode::kOpaque);
  expect_mode(half_png(255, 0), 0.5, 1, AlphaMode::kOpaque);  // it would hide everything
  for (const auto& [format, model] : quads(half_png(255, 0), 0.5, 1))
    EXPECT_EQ(testing::count_notes(model, "alpha-hides-all"), 1) << format;
}

}  // namespace texmesh::lost_test
