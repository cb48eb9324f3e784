#include <chrono>
#include <cmath>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "stages/image/decode_image.h"
#include "tests/pipeline/import/obj/obj_cases.h"
#include "tests/support/sanitizers.h"

namespace texmesh::import_obj_test {

using namespace testing;  // NOLINT: fixtures

TEST(ImportObj, QuadWithTextureCoordinates) {
  const Model m = import_text(kVertices + "f 1/1 2/2 3/3 4/4\n");
  EXPECT_EQ(m.mesh.positions.size(), 4u);
  EXPECT_EQ(m.mesh.triangles.size(), 2u);
  EXPECT_EQ(m.mesh.uv0[0], (Vec2f{0, 1})) << "v grows downwards in glTF";
  EXPECT_EQ(m.mesh.uv0[2], (Vec2f{1, 0}));
  EXPECT_EQ(count_notes(m, "no-colour"), 1);
}

TEST(ImportObj, NegativeIndicesAndMixedCorners) {
  EXPECT_EQ(import_text(kVertices + "f -4/-4 -3/-3 -2/-2 -1/-1\n").mesh,
            import_text(kVertices + "f 1/1 2/2 3/3 4/4\n").mesh);
  const Model m = import_text(kVertices + "vn 0 0 2\nf 1//1 2//-1 3//1\nf 1/1/1 3/3/1 4/4/1\nf 1 2 4\n");
  EXPECT_EQ(m.mesh.triangles.size(), 3u);
  EXPECT_EQ(m.mesh.normals[0], (Vec3f{0, 0, 1}));
  EXPECT_EQ(import_text("f 1 2 3\nv 0 0 0\nv 1 0 0\nv 0 1 0\n").mesh.triangles.size(), 1u)
      << "faces before their vertices";
}

TEST(ImportObj, CommentsContinuationsAndLineEnds) {
  const Mesh expected = import_text(kVertices + "f 1 2 3\n").mesh;
  EXPECT_EQ(import_text("\xef\xbb\xbf# c\r\n" + kVertices + "  f 1 2 \\\n 3 # a comment\n").mesh, expected);
  std::string mac = kVertices + "f 1 2 3\n";
  for (char& c : mac) c = c == '\n' ? '\r' : c;
  EXPECT_EQ(import_text(mac).mesh, expected);
  EXPECT_EQ(import_text(kVertices + "s off\ncstype bezier\nl 1 2\np 1\nf 1 2 3\n").mesh, expected);
  EXPECT_EQ(count_notes(import_text(kVertices + "l 1 2\np 1\nf 1 2 3\n"), "lines-and-points"), 1);
  EXPECT_EQ(count_notes(import_text(kVertices + "f 1 2\nf 1 2 3\n"), "face-without-area"), 1);
}

TEST(ImportObj, ConcavePolygonsStayInsideThemselves) {
  // An L of six corners, area 3; a fan from its first corner would cover the notch.
  for (int start = 0; start < 6; ++start) {
    const int xs[] = {0, 2, 2, 1, 1, 0}, ys[] = {0, 0, 1, 1, 2, 2};
    std::string text;
    for (int i = 0; i < 6; ++i) text += "v " + std::to_string(xs[i]) + " " + std::to_string(ys[i]) + " 3\n";
    text += "f";
    for (int i = 0; i < 6; ++i) text += " " + std::to_string((start + i) % 6 + 1);
    const Mesh mesh = import_text(text + "\n").mesh;
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
  const Mesh arrow = import_text("v 0 0 0\nv 2 -1 0\nv 0.5 0 0\nv 2 1 0\nf 1 2 3 4\n").mesh;
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
  EXPECT_EQ(import_text(text + face + "\n").mesh.triangles.size(), 4998u);
}

TEST(ImportObj, AFileWhoseOnlyFaceHasNoVerticesIsRefusedWithItsLine) {
  for (const char* f : {"1 2 5", "1 2 0", "1 2 -5", "1 2 99999999999", "1 2 2147483648",
                        "1 2 -9223372036854775808", "1 2 x", "1 2 3/x", "1 2 /3", "1 2 1.5"}) {
    const std::string error = input_error([&] { import_text(kVertices + "f " + f + "\n"); });
    EXPECT_NE(error.find("a.obj: line 9"), std::string::npos) << f << ": " << error;
  }
}

TEST(ImportObj, NumbersThatAreNoneAreErrorsAndNanIsNot) {
  for (const char* v : {"v 1 2", "v 1 two 3", "v", "vt", "vt x", "vn 1 2", "v 1,5 2 3"})
    EXPECT_NE(input_error([&] { import_text(kVertices + v + "\nf 1 2 3\n"); }).find("line 9"),
              std::string::npos)
        << v;
  for (const char* v : {"nan 0 0", "0 -nan(ind) 0", "0 0 1.#QNAN", "inf 0 0", "1e999 0 0"}) {
    const Model m = import_text(kVertices + "v " + v + "\nf 1 2 3\nf 1 2 5\n");
    EXPECT_EQ(m.mesh.triangles.size(), 1u) << v;
    EXPECT_EQ(count_notes(m, "non-finite-position"), 1) << v;
  }
  EXPECT_THROW(import_text("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), InputError);
  const Model uv = import_text(kVertices + "vt nan 3\nf 1/5 2/2 3/3\n");
  EXPECT_EQ(count_notes(uv, "non-finite-uv"), 1);
  EXPECT_EQ(uv.mesh.uv0[0], (Vec2f{0, 0}));
}

TEST(ImportObj, EmptyAndFaceless) {
  EXPECT_THROW(import_text(""), InputError);
  EXPECT_THROW(import_text("hello\n"), InputError);
  EXPECT_THROW(import_text(kVertices), InputError);
  EXPECT_THROW(import_text(std::string("\0\1\2\3", 4)), InputError);
}

TEST(ImportObj, FarAwayScansKeepTheirMillimetres) {
  const Model m = import_text(
      "v 5000000.001 4000000.002 100.003\nv 5000001.001 4000000.002 100.003\nv 5000000.001 4000001.002 "
      "100.003\nf 1 2 3\n");
  EXPECT_NE(m.mesh.origin.x, 0);
  const Vec3d p = to_double(m.mesh.positions[0]) + m.mesh.origin;
  EXPECT_NEAR(p.x, 5000000.001, 1e-7);
  EXPECT_NEAR(p.y, 4000000.002, 1e-7);
  EXPECT_NEAR(p.z, 100.003, 1e-7);
}

TEST(ImportObj, PartsAndMaterials) {
  const Model m = import_text(
      kVertices + "o one\nusemtl red wood\nf 1 2 3\ng two\nusemtl b\nf 1 3 4\no three\nf 2 3 4\n");
  EXPECT_EQ(m.mesh.part_names, (std::vector<std::string>{"one", "one/two", "three"}));
  EXPECT_EQ(m.mesh.triangle_part, (std::vector<std::uint16_t>{0, 1, 2}));
  EXPECT_EQ(m.mesh.triangle_material, (std::vector<std::uint16_t>{0, 1, 1}));
  EXPECT_EQ(m.materials[0].name, "red wood");
  EXPECT_EQ(count_notes(m, "missing-material"), 2) << "usemtl without mtllib";
}

TEST(ImportObj, ForeignContentIsRefusedAndForeignNamesAreNoted) {
  MemoryResolver resolver;
  resolver.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd t.jpg\n");
  resolver.files["t.jpg"] = testing::png_bytes(8, 8, 3);
  const Model m = import_text(kTextured, resolver);
  EXPECT_EQ(m.images[0].format, ImageFormat::kPng);
  EXPECT_EQ(count_notes(m, "image-extension"), 1);
  resolver.files["t.jpg"] = bytes_of("P6\n1 1\n255\nabc");
  EXPECT_NE(input_error([&] { import_text(kTextured, resolver); }).find("t.jpg"), std::string::npos);
}

TEST(ImportObj, VertexColours) {
  const std::string colours = "v 0 0 0 1 0 0.5\nv 1 0 0 1 0 0.5\nv 0 1 0\n";
  Model m = import_text(colours + "f 1 2 3\n");
  ASSERT_EQ(m.mesh.colours.size(), 3u);
  EXPECT_NEAR(m.mesh.colours[0].z, 0.21404, 1e-4);
  EXPECT_EQ(m.mesh.colours[2], (Vec4f{1, 1, 1, 1}));
  m = import_text("v 0 0 0 255 0 128\nv 1 0 0 0 0 0\nv 0 1 0 0 0 0\nf 1 2 3\n");
  EXPECT_NEAR(m.mesh.colours[0].z, 0.21586, 1e-4) << "0..255";
  EXPECT_TRUE(import_text("v 0 0 0 1\nv 1 0 0 1\nv 0 1 0 1\nf 1 2 3\n").mesh.colours.empty())
      << "w is no colour";
  MemoryResolver resolver;
  resolver.files["a.mtl"] = bytes_of("newmtl m\nmap_Kd c.png\nnewmtl k\nKd 0.8 0.8 0.8\n");
  resolver.files["c.png"] = testing::png_bytes(8, 8, 3);
  m = import_text("mtllib a.mtl\n" + colours + "vt 0 0\nusemtl m\nf 1/1 2/1 3/1\n", resolver);
  EXPECT_TRUE(m.mesh.colours.empty());
  EXPECT_EQ(count_notes(m, "colours-beside-texture"), 1);
  m = import_text("mtllib a.mtl\n" + colours + "usemtl k\nf 1 2 3\n", resolver);
  EXPECT_EQ(m.materials[0].base_colour, (Vec4f{1, 1, 1, 1})) << "the colours are the colour";
}

TEST(ImportObj, HugeUvRangesStay) {
  const Model m =
      import_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nvt -721.25 1553.5\nvt 0 0\nvt 1 0\nf 1/1 2/2 3/3\n");
  EXPECT_EQ(m.mesh.uv0[0], (Vec2f{-721.25f, -1552.5f}));
}

TEST(ImportObj, Limits) {
  MemoryResolver resolver;
  ImportOptions options;
  options.max_vertices = 3;
  EXPECT_THROW(import_text(kVertices + "f 1 2 3\n", resolver, options), InputError);
  options = {};
  options.max_triangles = 1;
  EXPECT_THROW(import_text(kVertices + "f 1 2 3 4\n", resolver, options), InputError);
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
      EXPECT_LE(import_text(kTextured.substr(0, n), resolver).mesh.triangles.size(), 2u);
    } catch (const InputError&) {
    }
  for (std::size_t n = 0; n < mtl.size(); ++n) {
    resolver.files["a.mtl"] = {mtl.begin(), mtl.begin() + static_cast<std::ptrdiff_t>(n)};
    EXPECT_EQ(import_text(kTextured, resolver).mesh.triangles.size(), 2u);
  }
  for (std::size_t i = 0; i < kTextured.size(); ++i)
    for (int bit : {0, 2, 4, 7}) {
      std::string text = kTextured;
      text[i] = static_cast<char>(text[i] ^ 1 << bit);
      try {
        import_text(text, resolver);
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
  EXPECT_EQ(import_text(text).mesh.triangles.size(), 2u * n * n);
  const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
  RecordProperty("seconds", std::to_string(seconds));
  EXPECT_LT(seconds, testing::sanitizers_take(20));
}

}  // namespace texmesh::import_obj_test
