#include <cmath>
#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::import_ply_test {

using testing::bytes_of;
using testing::count_notes;
using testing::input_error;
using testing::MemoryResolver;

Model import(const Bytes& bytes, Resolver& resolver, const ImportOptions& options = {}) {
  return import_ply("a.ply", bytes, resolver, options, {}).model;
}
Model import(const std::string& text) {
  MemoryResolver resolver;
  return import(bytes_of(text), resolver);
}

MemoryResolver with_texture() {
  MemoryResolver resolver;
  resolver.files["t.png"] = testing::png_bytes(8, 8, 3);
  resolver.files["my scan.png"] = testing::png_bytes(4, 8, 3);
  return resolver;
}

// A square of two triangles.
const std::string kSquare =
    "ply\nformat ascii 1.0\ncomment a test\nelement vertex 4\nproperty float x\nproperty float y\nproperty "
    "float z\n"
    "element face 2\nproperty list uchar int vertex_indices\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 "
    "2\n3 0 2 3\n";

// Writes numbers of any type in either byte order.
struct Binary {
  Bytes bytes;
  bool big = false;
  template <class T>
  Binary& operator()(T value) {
    std::uint8_t raw[sizeof(T)];
    std::memcpy(raw, &value, sizeof(T));
    for (std::size_t i = 0; i < sizeof(T); ++i) bytes.push_back(raw[big ? sizeof(T) - 1 - i : i]);
    return *this;
  }
};

// Every type, unknown elements before, between and behind, unknown properties, per-face UVs and colours.
Bytes rich_ply(bool big) {
  Binary b{bytes_of(std::string("ply\nformat binary_") + (big ? "big" : "little") +
                    "_endian 1.0\ncomment TextureFile   my scan.png  \nobj_info num_cols 2\n"
                    "element camera 1\nproperty list ushort double view\nproperty char id\n"
                    "element vertex 4\nproperty double x\nproperty float y\nproperty short z\nproperty list "
                    "uchar uint ids\n"
                    "property uint flags\nproperty float nx\nproperty float ny\nproperty float nz\n"
                    "element edge 1\nproperty int vertex1\nproperty int vertex2\n"
                    "element face 2\nproperty ushort group\nproperty list int ushort vertex_index\n"
                    "property list uchar float texcoord\nproperty int texnumber\n"
                    "element empty 2000000000\nend_header\n"),
           big};
  b(std::uint16_t{2})(1.0)(2.0)(std::int8_t{-1});
  for (int i = 0; i < 4; ++i) {
    b(i == 1 || i == 2 ? 1.5 : 0.5)(i > 1 ? 1.0f : 0.0f)(std::int16_t{-7});
    b(std::uint8_t(i));
    for (int k = 0; k < i; ++k) b(std::uint32_t{7});
    b(std::uint32_t{99})(0.0f)(0.0f)(2.0f);
  }
  b(std::int32_t{0})(std::int32_t{1});
  for (int f = 0; f < 2; ++f) {
    b(std::uint16_t{3})(std::int32_t{3})(std::uint16_t{0})(std::uint16_t(f + 1))(std::uint16_t(f + 2));
    b(std::uint8_t{6});
    for (int k = 0; k < 6; ++k) b(static_cast<float>(k) / 8 + static_cast<float>(f) * 0.25f);
    b(std::int32_t{f == 0 ? 0 : -1});
  }
  return b.bytes;
}

TEST(ImportPly, AHeaderOfLoneReturnsMayEndTheFile) {
  const std::string header =
      "ply\rformat binary_big_endian 1.0\relement face 1\rproperty list uchar int vertex_indices\rend_header";
  MemoryResolver resolver;
  EXPECT_THROW(import_ply("a.ply", testing::bytes_of(header), resolver, {}, {}), InputError);
}

TEST(ImportPly, AsciiSquare) {
  const Model m = import(kSquare);
  EXPECT_EQ(m.mesh.positions.size(), 4u);
  EXPECT_EQ(m.mesh.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 3}}));
  EXPECT_TRUE(m.mesh.uv0.empty() && m.mesh.normals.empty() && m.mesh.colours.empty());
  EXPECT_EQ(count_notes(m, "no-colour"), 1);
  EXPECT_EQ(m.materials.size(), 1u);
  EXPECT_TRUE(m.materials[0].double_sided);
}

TEST(ImportPly, LineEndsOfEverySystem) {
  for (const char* end : {"\r\n", "\r"}) {
    std::string text;
    for (char c : kSquare) c == '\n' ? text += end : text += c;
    EXPECT_EQ(import(text).mesh, import(kSquare).mesh);
  }
  std::string wrapped = kSquare;  // a row over two lines
  wrapped.replace(wrapped.find("1 1 0\n"), 6, "1 1\n0\n");
  EXPECT_EQ(import(wrapped).mesh, import(kSquare).mesh);
}

TEST(ImportPly, BothByteOrdersAllTypesAndUnknownElements) {
  for (bool big : {false, true}) {
    MemoryResolver resolver = with_texture();
    const Model m = import(rich_ply(big), resolver);
    ASSERT_EQ(m.mesh.positions.size(), 4u);
    EXPECT_EQ(to_double(m.mesh.positions[2]) + m.mesh.origin, (Vec3d{1.5, 1, -7}));
    EXPECT_EQ(m.mesh.triangles.size(), 2u);
    EXPECT_EQ(resolver.asked, (std::vector<std::string>{"my scan.png"}))
        << "blanks around the name are none of it";
    ASSERT_EQ(m.images.size(), 1u);
    ASSERT_EQ(m.materials.size(), 2u) << "texnumber -1 is untextured";
    EXPECT_TRUE(m.materials[m.mesh.triangle_material[0]].base_colour_texture.used());
    EXPECT_FALSE(m.materials[m.mesh.triangle_material[1]].base_colour_texture.used());
    const Vec2f uv = m.mesh.uv0[m.mesh.triangles[0][1]];
    EXPECT_FLOAT_EQ(uv.x, 0.25f);
    EXPECT_FLOAT_EQ(uv.y, 1 - 0.375f);
    EXPECT_EQ(m.mesh.normals[0], (Vec3f{0, 0, 1}));
    EXPECT_EQ(m.mesh.wedge_count(), 5u) << "the triangles share two corners, one of them with the same UV";
  }
}

TEST(ImportPly, VertexUvNames) {
  for (const auto& [u, v] : {std::pair{"s", "t"}, {"u", "v"}, {"texture_u", "texture_v"}}) {
    MemoryResolver resolver = with_texture();
    const std::string text =
        std::string(
            "ply\nformat ascii 1.0\ncomment TextureFile t.png\nelement vertex 3\nproperty float x\n"
            "property float y\nproperty float z\nproperty float ") +
        u + "\nproperty float " + v +
        "\nelement face 1\nproperty list uchar int vertex_indices\nend_header\n0 0 0 0 0\n1 0 0 1 0\n"
        "0 1 0 0.25 1500.5\n3 0 1 2\n";
    const Model m = import(bytes_of(text), resolver);
    EXPECT_EQ(m.mesh.uv0[2], (Vec2f{0.25f, -1499.5f})) << "a chart over a huge range stays where it is";
    EXPECT_TRUE(m.materials[0].base_colour_texture.used());
    EXPECT_EQ(m.materials[0].base_colour_texture.wrap_s, Wrap::kRepeat);
  }
}

TEST(ImportPly, ColoursBecomeLinear) {
  const std::string head =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::string faces = "element face 1\nproperty list uchar int vertex_indices\nend_header\n";
  const Model bytes =
      import(head + "property uchar red\nproperty uchar green\nproperty uchar blue\nproperty uchar alpha\n" +
             faces + "0 0 0 255 0 128 51\n1 0 0 0 0 0 255\n0 1 0 1 2 3 255\n3 0 1 2\n");
  ASSERT_EQ(bytes.mesh.colours.size(), 3u);
  EXPECT_EQ(bytes.mesh.colours[0].x, 1);
  EXPECT_NEAR(bytes.mesh.colours[0].z, 0.21586, 1e-4);
  EXPECT_NEAR(bytes.mesh.colours[0].w, 0.2, 1e-6);
  const Model floats = import(head + "property float red\nproperty float green\nproperty float blue\n" +
                              faces + "0 0 0 1 0 0.5\n1 0 0 nan 7 -1\n0 1 0 0 0 0\n3 0 1 2\n");
  EXPECT_NEAR(floats.mesh.colours[0].z, 0.21404, 1e-4);
  EXPECT_EQ(floats.mesh.colours[1], (Vec4f{1, 1, 0, 1})) << "clamped; NaN gives no tint";
  const Model wide = import(head + "property float Red\nproperty float Green\nproperty float Blue\n" + faces +
                            "0 0 0 255 0 128\n1 0 0 0 0 0\n0 1 0 0 0 0\n3 0 1 2\n");
  ASSERT_EQ(wide.mesh.colours.size(), 3u) << "names in any case";
  EXPECT_EQ(wide.mesh.colours[0].x, 1);
  EXPECT_NEAR(wide.mesh.colours[0].z, 0.21586, 1e-4) << "0..255, as in OBJ";
}

TEST(ImportPly, FaceColoursAreKeptPerCorner) {
  const Model m = import(
      "ply\nformat ascii 1.0\nelement vertex 4\nproperty float x\nproperty float y\nproperty float "
      "z\nelement face 2\n"
      "property list uchar int vertex_indices\nproperty uchar red\nproperty uchar green\nproperty uchar "
      "blue\nend_header\n"
      "0 0 0\n1 0 0\n1 1 0\n0 1 0\n3 0 1 2 255 0 0\n3 0 2 3 0 0 255\n");
  EXPECT_EQ(m.mesh.wedge_count(), 6u);
  for (std::uint32_t w : m.mesh.triangles[0]) EXPECT_EQ(m.mesh.colours[w], (Vec4f{1, 0, 0, 1}));
  for (std::uint32_t w : m.mesh.triangles[1]) EXPECT_EQ(m.mesh.colours[w], (Vec4f{0, 0, 1, 1}));
}

// The exporter bug of fuze_ascii.ply: a colour per corner where the header declares one per face.
const std::string kOverLong =
    "ply\nformat ascii 1.0\nTEXelement vertex 4\nproperty float x\nproperty float y\nproperty float "
    "z\nelement face 2\n"
    "property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty uchar "
    "red\nproperty uchar green\n"
    "property uchar blue\nproperty uchar alpha\nend_header\n0 0 0\n1 0 0\n1 1 0\n0 1 0\n"
    "3 0 1 2 6 0 0 1 0 1 1 9 1 0 0 0 1 0 0 0 1 \n3 0 2 3 6 0.5 0 1 1 0 1 9 1 1 1 1 1 1 1 1 1 \n";

TEST(ImportPly, OverLongLinesLoseNothing) {
  std::string text = kOverLong;
  text.replace(text.find("TEX"), 3, "comment TextureFile t.png\n");
  MemoryResolver resolver = with_texture();
  const Model m = import(bytes_of(text), resolver);
  EXPECT_EQ(m.mesh.triangles.size(), 2u);
  EXPECT_EQ(count_notes(m, "over-long-lines"), 1);
  EXPECT_EQ(m.mesh.uv0[m.mesh.triangles[1][0]], (Vec2f{0.5f, 1}));
  EXPECT_EQ(m.mesh.uv0[m.mesh.triangles[1][2]], (Vec2f{0, 0}));
  EXPECT_TRUE(m.mesh.colours.empty()) << "the texture shows";
  text = kOverLong;
  text.replace(text.find("TEX"), 3, "");
  const Model plain = import(text);
  EXPECT_EQ(plain.mesh.colours[plain.mesh.triangles[0][0]], (Vec4f{1, 0, 0, 1}));
  EXPECT_EQ(plain.mesh.colours[plain.mesh.triangles[0][2]], (Vec4f{0, 0, 1, 1}));
}

TEST(ImportPly, SeveralTexturesAndMissingOnes) {
  const std::string text =
      "ply\nformat ascii 1.0\ncomment TextureFile t.png\ncomment TextureFile my scan.png\ncomment "
      "texturefile gone.png\n"
      "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 3\n"
      "property list uchar int vertex_indices\nproperty list uchar float texcoord\nproperty int "
      "texnumber\nend_header\n"
      "0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1 0\n3 0 1 2 6 0 0 1 0 1 1 1\n3 0 1 2 6 0 0 1 0 1 1 2\n";
  MemoryResolver resolver = with_texture();
  const Model m = import(bytes_of(text), resolver);
  ASSERT_EQ(m.images.size(), 2u);
  EXPECT_EQ(
      m.images[static_cast<std::size_t>(m.materials[m.mesh.triangle_material[1]].base_colour_texture.image)]
          .name,
      "my scan.png");
  EXPECT_EQ(count_notes(m, "missing-texture"), 1);
  EXPECT_FALSE(m.materials[m.mesh.triangle_material[2]].base_colour_texture.used());
}

TEST(ImportPly, TexturesThatNoFaceChoosesAreTold) {
  std::string text = kSquare;
  text.replace(text.find("comment a test"), 14, "comment TextureFile t.png\ncomment TextureFile my scan.png");
  text.replace(text.find("z\n") + 2, 0, "property float s\nproperty float t\n");
  text.replace(text.find("0 0 0\n1 0 0\n1 1 0\n0 1 0"), 23, "0 0 0 0 0\n1 0 0 1 0\n1 1 0 1 1\n0 1 0 0 1");
  MemoryResolver resolver = with_texture();
  const Model m = import(bytes_of(text), resolver);
  EXPECT_EQ(count_notes(m, "odd-texture-number"), 1);
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.images[0].name, "t.png");
}

TEST(ImportPly, RowsBehindTheDeclaredOnesAreTold) {
  EXPECT_EQ(count_notes(import(kSquare + "\n \n"), "trailing-bytes"), 0);
  EXPECT_EQ(count_notes(import(kSquare + "3 0 1 3\n"), "trailing-bytes"), 1);
  MemoryResolver resolver = with_texture();
  for (const bool big : {false, true}) {
    Bytes rich = rich_ply(big);
    EXPECT_EQ(count_notes(import(rich, resolver), "trailing-bytes"), 0);
    rich.push_back(7);
    EXPECT_EQ(count_notes(import(rich, resolver), "trailing-bytes"), 1);
  }
}

TEST(ImportPly, TextureNumbersBeyondTheLastAreTold) {
  const auto textured = [](const std::string& first, const std::string& second, const std::string& more) {
    MemoryResolver resolver = with_texture();
    const Model m = import(
        bytes_of("ply\nformat ascii 1.0\ncomment TextureFile t.png\n" + more +
                 "element vertex 3\nproperty float x\nproperty float y\nproperty float z\nelement face 2\n"
                 "property list uchar int vertex_indices\nproperty list uchar float texcoord\n"
                 "property int texnumber\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2 6 0 0 1 0 1 1 " +
                 first + "\n3 2 1 0 6 0 0 1 0 1 1 " + second + "\n"),
        resolver);
    EXPECT_EQ(count_notes(m, "odd-texture-number"), 1);
    std::size_t count = 0;
    for (const std::uint16_t material : m.mesh.triangle_material)
      count += m.materials[material].base_colour_texture.used();
    return count;
  };
  EXPECT_EQ(textured("1", "1", ""), 2u) << "counted from 1";
  EXPECT_EQ(textured("1", "2", ""), 0u) << "two textures, of which one is named";
  EXPECT_EQ(textured("0", "2", "comment TextureFile my scan.png\n"), 1u);
}

TEST(ImportPly, PolygonsAndStrips) {
  std::string text = kSquare;
  text.replace(text.find("element face 2"), 14, "element face 1");
  text.replace(text.find("3 0 1 2\n3 0 2 3\n"), 16, "4 0 1 2 3\n");
  EXPECT_EQ(import(text).mesh.triangles.size(), 2u);
  text = kSquare;
  text.replace(text.find("element face 2"), 14, "element tristrips 1");
  text.replace(text.find("3 0 1 2\n3 0 2 3\n"), 16, "8 0 1 3 2 -1 0 1 2\n");
  const Mesh mesh = import(text).mesh;
  EXPECT_EQ(mesh.triangles.size(), 3u);
  for (std::uint32_t t = 0; t < 3; ++t) {
    Vec3f p[3];
    for (int c = 0; c < 3; ++c) p[c] = mesh.positions[mesh.position_of(t, c)];
    const Vec3f n = cross(p[1] - p[0], p[2] - p[0]);
    EXPECT_GT(n.z, 0) << "every second triangle of a strip is turned";
  }
}

TEST(ImportPly, EveryTruncationIsAnError) {
  for (const Bytes& whole :
       {bytes_of(kSquare.substr(0, kSquare.size() - 1)), rich_ply(false), rich_ply(true)})
    for (std::size_t n = 0; n < whole.size(); ++n) {
      MemoryResolver resolver = with_texture();
      EXPECT_THROW(import({whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n)}, resolver),
                   InputError)
          << n;
    }
}

TEST(ImportPly, FlippedBytesNeverHarm) {
  ImportOptions options;
  options.max_vertices = options.max_triangles = 100000;
  for (const Bytes& whole : {bytes_of(kSquare), bytes_of(kOverLong), rich_ply(false)})
    for (std::size_t i = 0; i < whole.size(); ++i)
      for (int bit : {0, 1, 4, 7}) {
        Bytes bytes = whole;
        bytes[i] = static_cast<std::uint8_t>(bytes[i] ^ 1 << bit);
        MemoryResolver resolver = with_texture();
        try {
          import(bytes, resolver, options);
        } catch (const InputError&) {
        }
      }
}

TEST(ImportPly, HostileCounts) {
  for (const char* count :
       {"2147483648", "4294967295", "9223372036854775807", "99999999999999999999", "-1", "1e3", ""}) {
    std::string text = kSquare;
    text.replace(text.find("vertex 4"), 8, std::string("vertex ") + count);
    EXPECT_THROW(import(text), InputError) << count;
    text = kSquare;
    text.replace(text.find("face 2"), 6, std::string("face ") + count);
    EXPECT_THROW(import(text), InputError) << count;
  }
  for (const char* row : {"2147483647 0 1 2", "-3 0 1 2", "3.5 0 1 2", "nan 0 1 2", "3 0 1 x"}) {
    std::string text = kSquare;
    text.replace(text.find("3 0 1 2"), 7, row);
    EXPECT_THROW(import(text), InputError) << row;
  }
  Binary b{
      bytes_of("ply\nformat binary_little_endian 1.0\nelement vertex 3\nproperty float x\nproperty float "
               "y\nproperty float z\n"
               "element face 1\nproperty list uint int vertex_indices\nend_header\n")};
  for (int i = 0; i < 9; ++i) b(1.0f);
  b(std::uint32_t{0x80000000u})(std::int32_t{0})(std::int32_t{1})(std::int32_t{2});
  MemoryResolver resolver;
  EXPECT_THROW(import(b.bytes, resolver), InputError);
  ImportOptions options;
  options.max_vertices = 3;
  EXPECT_THROW(import(bytes_of(kSquare), resolver, options), InputError);
}

TEST(ImportPly, FaultsNameLineExpectedAndFound) {
  std::string text = kSquare;
  text.replace(text.find("1 1 0"), 5, "1 one 0");
  const std::string error = input_error([&] { import(text); });
  EXPECT_NE(error.find("a.ply"), std::string::npos) << error;
  EXPECT_NE(error.find("line 13"), std::string::npos) << error;
  EXPECT_NE(error.find("\"one\""), std::string::npos) << error;
}

TEST(ImportPly, AListThatTheFileEndsInIsTold) {
  const std::string cut = input_error([] { import(kSquare.substr(0, kSquare.size() - 7)); });
  EXPECT_NE(cut.find("a list of 3 numbers, found 0 bytes left in the file, which is cut off"), cut.npos)
      << cut;
  std::string text = kSquare;
  text.replace(text.find("3 0 1 2"), 7, "-3 0 1 2");
  const std::string negative = input_error([&] { import(text); });
  EXPECT_NE(negative.find("a list length, 0 or more, found -3"), negative.npos) << negative;
}

TEST(ImportPly, BadHeadersAndNoFaces) {
  for (const char* text :
       {"ply", "ply\n", "ply\nend_header\n", "ply\nformat ascii 2.0\nend_header\n",
        "ply\nformat text 1.0\nend_header\n", "plyx\n",
        "ply\nformat ascii 1.0\nproperty float x\nend_header\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty quad x\nend_header\n1\n",
        "ply\nformat ascii 1.0\nelement vertex 1\nproperty list float x\nend_header\n1\n",
        "ply\nformat ascii 1.0\nnonsense\nend_header\n",
        "ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_indices\nend_header\n"})
    EXPECT_THROW(import(text), InputError) << text;
  std::string cloud = kSquare;
  cloud.replace(cloud.find("element face 2"), 14, "element other 2");
  EXPECT_NE(input_error([&] { import(cloud); }).find("point cloud of 4 points"), std::string::npos);
  std::string zero = kSquare;
  zero.replace(zero.find("element face 2"), 14, "element face 0");
  EXPECT_THROW(import(zero), InputError);
}

TEST(ImportPly, SomeNanPositionsAreAWarningAllAreAnError) {
  std::string text = kSquare;
  text.replace(text.find("0 1 0"), 5, "0 nan 0");
  const Model m = import(text);
  EXPECT_EQ(m.mesh.triangles.size(), 1u);
  EXPECT_EQ(count_notes(m, "non-finite-position"), 1);
  for (const Vec3f& p : m.mesh.positions) EXPECT_TRUE(std::isfinite(p.y));
  text.replace(text.find("0 0 0"), 5, "0 inf 0");
  EXPECT_THROW(import(text), InputError);
}

TEST(ImportPly, PartsOfWhatCannotBeReadAreCounted) {
  std::string text =
      "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float y\nproperty float z\n";
  const std::vector<std::string> parts{"red", "green", "alpha", "nx", "ny", "s"};  // no blue, no nz, no t
  for (const std::string& name : parts) text += "property float " + name + "\n";
  text +=
      "element face 1\nproperty list uchar int vertex_indices\nproperty uchar blue\nend_header\n"
      "0 0 0 1 1 1 1 1 1\n1 0 0 1 1 1 1 1 1\n0 1 0 1 1 1 1 1 1\n3 0 1 2 9\n";
  MemoryResolver resolver;
  const ImportedModel read = import_ply("a.ply", bytes_of(text), resolver, {}, {});
  for (const std::string& name : parts) EXPECT_EQ(read.lost.at("values \"" + name + "\" of vertex"), 3u);
  EXPECT_EQ(read.lost.at("values \"blue\" of face"), 1u);
}

}  // namespace texmesh::import_ply_test
