#include <cmath>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "format/base/vec.h"
#include "pipeline/import/import.h"
#include "tests/support/images.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::import_range_test {

using testing::bytes_of;
using testing::count_notes;
using testing::encode_image;
using testing::input_error;
using testing::MemoryResolver;

std::string description(const std::string& more = "", const std::string& grid = "r.pgm") {
  return R"({"version":1,"type":"cylindrical-range-scan","y_step":0.5,"grid":")" + grid + "\"" + more + "}";
}

Bytes pgm16(int width, int height, const std::vector<std::uint16_t>& values,
            const std::string& comment = "") {
  Bytes bytes =
      bytes_of("P5\n" + comment + std::to_string(width) + " " + std::to_string(height) + "\n65535\n");
  for (std::uint16_t v : values) {
    bytes.push_back(static_cast<std::uint8_t>(v >> 8));
    bytes.push_back(static_cast<std::uint8_t>(v & 255));
  }
  return bytes;
}

ImportedModel import(const std::string& json, MemoryResolver& resolver, const ImportOptions& options = {}) {
  return import_range_scan("scan.json", bytes_of(json), resolver, options, {});
}

// Outward: the normal points away from the axis.
void expect_outward(const Mesh& mesh) {
  for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
    Vec3f p[3];
    for (int k = 0; k < 3; ++k) p[k] = mesh.positions[mesh.position_of(static_cast<std::uint32_t>(t), k)];
    const Vec3f n = cross(p[1] - p[0], p[2] - p[0]);
    EXPECT_GT(n.x * (p[0].x + p[1].x + p[2].x) + n.z * (p[0].z + p[1].z + p[2].z), 0) << t;
  }
}

MemoryResolver cylinder(int columns, int rows, std::uint16_t radius = 200) {
  MemoryResolver resolver;
  resolver.files["r.pgm"] =
      pgm16(columns, rows, std::vector<std::uint16_t>(static_cast<std::size_t>(columns * rows), radius));
  return resolver;
}

TEST(ImportRange, AFullTurnIsAClosedTubeWithASeam) {
  MemoryResolver resolver = cylinder(12, 5);
  const ImportedModel m = import(description(R"(,"radius_scale":0.01)"), resolver);
  const Mesh& mesh = m.model.mesh;
  EXPECT_EQ(m.format, "range");
  EXPECT_EQ(mesh.positions.size(), 60u);
  EXPECT_EQ(mesh.wedge_count(), 65u) << "one more per row at the seam";
  EXPECT_EQ(mesh.triangles.size(), 12u * 4 * 2);
  expect_outward(mesh);
  EXPECT_NEAR(mesh.positions[0].z, 2, 1e-6) << "column 0 looks along +z";
  EXPECT_NEAR(mesh.positions[0].y, 2, 1e-6) << "rows fall from the top; the last one is at 0";
  EXPECT_NEAR(mesh.positions[3].x, 2, 1e-6) << "a quarter turn later along +x";
  EXPECT_NEAR(mesh.positions[59].y, 0, 1e-6);
  EXPECT_FLOAT_EQ(mesh.uv0[0].x, 0.5f / 12);
  EXPECT_FLOAT_EQ(mesh.uv0[60].x, 12.5f / 12);
  EXPECT_FLOAT_EQ(mesh.uv0[60].y, 0.5f / 5);
  for (const Triangle& t : mesh.triangles) {
    float lo = 9, hi = -9;
    for (std::uint32_t w : t) lo = std::min(lo, mesh.uv0[w].x), hi = std::max(hi, mesh.uv0[w].x);
    EXPECT_LT(hi - lo, 0.1f) << "no cell runs backwards over the picture";
  }
  const RangeGrid& range = m.model.range;
  EXPECT_EQ(range.columns, 12u);
  EXPECT_EQ(range.rows, 5u);
  EXPECT_TRUE(range.full_turn);
  EXPECT_NEAR(range.alpha_step_rad, 2 * 3.14159265 / 12, 1e-6);
  EXPECT_FLOAT_EQ(range.y_step, 0.5f);
  for (std::uint32_t i = 0; i < 60; ++i) {
    EXPECT_EQ(range.position[i], i);
    EXPECT_FLOAT_EQ(range.radius[i], 2);
  }
}

TEST(ImportRange, APartOfATurnHasBordersAndNoSeam) {
  MemoryResolver resolver = cylinder(7, 3);
  const ImportedModel m = import(description(R"(,"alpha_step_deg":10,"alpha_start_deg":90)"), resolver);
  EXPECT_FALSE(m.model.range.full_turn);
  EXPECT_EQ(m.model.mesh.wedge_count(), 21u);
  EXPECT_EQ(m.model.mesh.triangles.size(), 6u * 2 * 2);
  EXPECT_NEAR(m.model.mesh.positions[0].x, 200, 1e-4);
  expect_outward(m.model.mesh);
}

TEST(ImportRange, ClockwiseScansKeepTheirFrontFaces) {
  MemoryResolver resolver = cylinder(12, 3);
  const ImportedModel m = import(description(R"(,"direction":"clockwise")"), resolver);
  EXPECT_NEAR(m.model.mesh.positions[3].x, -200, 1e-4);
  expect_outward(m.model.mesh);
}

TEST(ImportRange, MissingSamplesAreHoles) {
  std::vector<std::uint16_t> values(6 * 4, 500);
  values[1 * 6 + 2] = 0;      // not above 0
  values[2 * 6 + 5] = 60000;  // above valid_max
  MemoryResolver resolver;
  resolver.files["r.pgm"] = pgm16(6, 4, values, "# a comment\n");
  const ImportedModel m = import(description(R"(,"valid_max":50000)"), resolver);
  EXPECT_EQ(m.model.mesh.positions.size(), 22u);
  EXPECT_EQ(m.model.range.position[1 * 6 + 2], kNoIndex);
  EXPECT_EQ(m.model.range.radius[2 * 6 + 5], 0);
  // Each missing sample touches four cells, which keep one triangle of two.
  EXPECT_EQ(m.model.mesh.triangles.size(), 6u * 3 * 2 - 8);
  for (std::size_t i = 0; i < m.model.range.position.size(); ++i) {
    const std::uint32_t p = m.model.range.position[i];
    if (p != kNoIndex)
      EXPECT_NEAR(std::hypot(m.model.mesh.positions[p].x, m.model.mesh.positions[p].z),
                  m.model.range.radius[i], 1e-3);
  }
}

TEST(ImportRange, ALonelySampleHasNoPosition) {
  std::vector<std::uint16_t> values(8 * 6, 0);
  values[0] = values[1] = values[8] = values[9] = 100;
  values[3 * 8 + 5] = 100;
  MemoryResolver resolver;
  resolver.files["r.pgm"] = pgm16(8, 6, values);
  const ImportedModel m = import(description(), resolver);
  EXPECT_EQ(m.model.mesh.positions.size(), 4u);
  EXPECT_EQ(m.model.range.position[3 * 8 + 5], kNoIndex);
  EXPECT_EQ(count_notes(m.model, "unused-vertices"), 1);
  EXPECT_EQ(m.model.range.position[9], 3u);
}

TEST(ImportRange, RimsAreCutOnRequest) {
  std::vector<std::uint16_t> values(8 * 2, 100);
  values[3] = values[8 + 3] = 400;
  MemoryResolver resolver;
  resolver.files["r.pgm"] = pgm16(8, 2, values);
  EXPECT_EQ(import(description(), resolver).model.mesh.triangles.size(), 16u);
  EXPECT_EQ(import(description(R"(,"max_radius_step":50)"), resolver).model.mesh.triangles.size(), 12u);
}

TEST(ImportRange, ExrTiffAndPngGrids) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  std::vector<float> floats(10 * 4, 1.25f);
  floats[7] = nan;
  floats[8] = -3;
  MemoryResolver resolver;
  resolver.files["r.exr"] = encode_image("openexr", 10, 4, 1, floats, OIIO::TypeDesc::FLOAT);
  resolver.files["r.tif"] = encode_image("tiff", 10, 4, 1, floats, OIIO::TypeDesc::FLOAT);
  const std::vector<std::uint16_t> words(10 * 4, 1250);
  resolver.files["w.tif"] = encode_image("tiff", 10, 4, 1, words, OIIO::TypeDesc::UINT16);
  resolver.files["w.png"] = encode_image("png", 10, 4, 1, words, OIIO::TypeDesc::UINT16);
  for (const char* grid : {"r.exr", "r.tif"}) {
    const Model m = import(description("", grid), resolver).model;
    EXPECT_EQ(m.mesh.positions.size(), 38u) << grid;
    EXPECT_FLOAT_EQ(m.range.radius[0], 1.25f);
    EXPECT_EQ(m.range.radius[7], 0);
  }
  for (const char* grid : {"w.tif", "w.png"})
    EXPECT_FLOAT_EQ(import(description(R"(,"radius_scale":0.001)", grid), resolver).model.range.radius[39],
                    1.25f)
        << grid;
}

TEST(ImportRange, TextureAndItsAbsence) {
  MemoryResolver resolver = cylinder(8, 4);
  resolver.files["c.png"] = testing::png_bytes(16, 8, 3);
  Model m = import(description(R"(,"texture":"c.png")"), resolver).model;
  ASSERT_EQ(m.images.size(), 1u);
  EXPECT_EQ(m.materials[0].base_colour_texture.wrap_s, Wrap::kRepeat);
  EXPECT_EQ(m.materials[0].base_colour_texture.wrap_t, Wrap::kClamp);
  m = import(description(R"(,"texture":"gone.png")"), resolver).model;
  EXPECT_EQ(count_notes(m, "missing-texture"), 1);
  EXPECT_FALSE(m.materials[0].base_colour_texture.used());
}

TEST(ImportRange, BadGridsAreRefused) {
  MemoryResolver resolver = cylinder(8, 4);
  const Bytes good = resolver.files["r.pgm"];
  for (std::size_t n = 0; n < good.size(); ++n) {
    resolver.files["r.pgm"] = {good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)};
    EXPECT_THROW(import(description(), resolver), InputError) << n;
  }
  for (const char* text :
       {"P5 99999 99999 65535\n", "P5 4294967296 1 255\n", "P5 2 2 0\nabcd", "P5 2 2 70000\nabcdefgh",
        "P2 2 2 9\n1 1 1 1", "P5 0 4 255\n", "P5 1 1 255\nx", "P5 3 1 255\nxxx", "P5#", "P5\n#"}) {
    resolver.files["r.pgm"] = bytes_of(text);
    EXPECT_THROW(import(description(), resolver), InputError) << text;
  }
  resolver.files["r.pgm"] = testing::jpeg_bytes(8, 4, 1);
  EXPECT_THROW(import(description(), resolver), InputError) << "a lossy grid";
  resolver.files["r.pgm"] = testing::png_bytes(8, 4, 3);
  EXPECT_THROW(import(description(), resolver), InputError) << "three channels";
  resolver.files.clear();
  EXPECT_NE(input_error([&] { import(description(), resolver); }).find("looked for"), std::string::npos);
  EXPECT_THROW(import(description("", "../r.pgm"), resolver), InputError);
  resolver = cylinder(8, 4, 0);
  EXPECT_THROW(import(description(), resolver), InputError) << "no sample at all";
  resolver = cylinder(8, 4);
  ImportOptions options;
  options.max_vertices = 31;
  EXPECT_THROW(import(description(), resolver, options), InputError);
  EXPECT_THROW(import(description(R"(,"alpha_step_deg":60)"), resolver), InputError) << "more than a turn";
}

TEST(ImportRange, FaultsOfTheJsonNameTheirPlace) {
  MemoryResolver resolver = cylinder(8, 4);
  EXPECT_NE(
      input_error([&] { import(description(R"(,"alpha_step_deg":0)"), resolver); }).find("/alpha_step_deg"),
      std::string::npos);
  EXPECT_NE(input_error([&] { import(description(R"(,"colour":1)"), resolver); }).find("/colour"),
            std::string::npos);
  EXPECT_THROW(import(std::string(100000, '['), resolver), InputError);
  const std::string good = description(R"(,"radius_offset":-3.5)");
  for (std::size_t n = 0; n < good.size(); ++n)
    EXPECT_THROW(import(good.substr(0, n), resolver), InputError) << n;
}

Bytes cyberware(int columns, int rows, const std::vector<std::int16_t>& values,
                const std::string& more = "") {
  Bytes bytes =
      bytes_of("Cyberware Digitizer Data\nNAME=head\nDATE=Wed Dec 31 16:00:00 1969\nSPACE=CYLINDRICAL\nNLG=" +
               std::to_string(columns) + "\nLGINCR=" + std::to_string(6283185 / columns) + "\nLGMIN=0\nNLT=" +
               std::to_string(rows) + "\nLTINCR=700\nLGSHIFT=0\nRSHIFT=5\nSCALE=100.0\n" + more + "DATA=\n");
  for (std::int16_t v : values) {
    bytes.push_back(static_cast<std::uint8_t>(static_cast<std::uint16_t>(v) >> 8));
    bytes.push_back(static_cast<std::uint8_t>(v & 255));
  }
  return bytes;
}

TEST(ImportRange, CyberwareFiles) {
  std::vector<std::int16_t> values(16 * 5, 3125);  // 3125 << 5 micrometres = 100 mm
  values[2 * 5 + 0] = -32768;                      // longitude 2, the lowest latitude
  MemoryResolver resolver;
  for (const char* more : {"THETA_RIGHTHAND=TRUE\n", ""}) {
    const ImportedModel m = import_range_scan("head.cyl", cyberware(16, 5, values, more), resolver, {}, {});
    EXPECT_EQ(m.model.range.columns, 16u);
    EXPECT_EQ(m.model.range.rows, 5u);
    EXPECT_TRUE(m.model.range.full_turn);
    EXPECT_FLOAT_EQ(m.model.range.radius[0], 100);
    EXPECT_EQ(m.model.range.radius[4 * 16 + 2], 0) << "the lowest latitude is the last row";
    EXPECT_EQ(m.model.mesh.positions.size(), 79u);
    EXPECT_FLOAT_EQ(m.model.mesh.positions[0].y, 2.8f);
    EXPECT_EQ(m.model.mesh.positions[4].x > 0, *more != 0);
    expect_outward(m.model.mesh);
  }
}

TEST(ImportRange, CyberwareHostile) {
  const std::vector<std::int16_t> values(4 * 3, 3125);
  const Bytes good = cyberware(4, 3, values);
  MemoryResolver resolver;
  const auto read = [&](const Bytes& bytes) { import_range_scan("head.cyl", bytes, resolver, {}, {}); };
  EXPECT_NO_THROW(read(good));
  for (std::size_t n = 9; n < good.size(); ++n)
    EXPECT_THROW(read({good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n)}), InputError) << n;
  EXPECT_THROW(read(cyberware(65535, 65535, values)), InputError);
  EXPECT_THROW(read(cyberware(1, 3, values)), InputError);
  EXPECT_THROW(read(bytes_of("Cyberware Digitizer Data\nSPACE=CARTESIAN\nDATA=\n")), InputError);
  EXPECT_THROW(read(bytes_of("Cyberware of another kind\nDATA=\n")), InputError);
  for (std::size_t i = 0; i < good.size(); ++i) {
    Bytes bytes = good;
    bytes[i] = static_cast<std::uint8_t>(bytes[i] ^ 0x15);
    try {
      read(bytes);
    } catch (const InputError&) {
    }
  }
}

TEST(ImportRange, TheSameBytesEveryTime) {
  MemoryResolver resolver = cylinder(40, 30);
  EXPECT_EQ(import(description(), resolver).model, import(description(), resolver).model);
}

}  // namespace texmesh::import_range_test
