#include <cstring>
#include <limits>

#include <gtest/gtest.h>

#include "format/base/errors.h"
#include "pipeline/import/import.h"
#include "tests/support/memory_resolver.h"

namespace texmesh::import_stl_test {

using testing::bytes_of;
using testing::count_notes;
using testing::input_error;

// A tetrahedron: 4 triangles, 4 points.
const std::vector<std::array<Vec3f, 3>> kTetrahedron{{{{0, 0, 0}, {0, 1, 0}, {1, 0, 0}}},
                                                     {{{0, 0, 0}, {1, 0, 0}, {0, 0, 1}}},
                                                     {{{0, 0, 0}, {0, 0, 1}, {0, 1, 0}}},
                                                     {{{1, 0, 0}, {0, 1, 0}, {-0.0f, 0, 1}}}};

Bytes binary_stl(const std::vector<std::array<Vec3f, 3>>& triangles, std::string header = "made by a test") {
  header.resize(80, ' ');
  Bytes bytes = bytes_of(header);
  const auto put = [&bytes](const auto& value) {
    const auto* p = reinterpret_cast<const std::uint8_t*>(&value);
    bytes.insert(bytes.end(), p, p + sizeof value);
  };
  put(static_cast<std::uint32_t>(triangles.size()));
  for (const auto& t : triangles) {
    put(Vec3f{0, 0, 0});
    for (const Vec3f& p : t) put(p);
    put(std::uint16_t{0x1234});
  }
  return bytes;
}

std::string ascii_stl(const char* end_of_line = "\n") {
  std::string s = std::string("solid thing with a name") + end_of_line;
  for (const auto& t : kTetrahedron) {
    s += std::string("  facet normal 0 0 0") + end_of_line + "    outer loop" + end_of_line;
    for (const Vec3f& p : t)
      s += "      vertex " + std::to_string(p.x) + " " + std::to_string(p.y) + " " + std::to_string(p.z) +
           end_of_line;
    s += std::string("    endloop") + end_of_line + "  endfacet" + end_of_line;
  }
  return s + "endsolid";
}

ImportedModel import(const Bytes& bytes, const ImportOptions& options = {}) {
  return import_stl("a.stl", bytes, options, {});
}

void expect_tetrahedron(const ImportedModel& m) {
  EXPECT_EQ(m.format, "stl");
  EXPECT_FALSE(m.normals_by_specification);
  EXPECT_EQ(m.model.mesh.positions.size(), 4u);
  EXPECT_EQ(m.model.mesh.wedge_count(), 4u);
  EXPECT_EQ(m.model.mesh.triangles.size(), 4u);
  EXPECT_TRUE(m.model.mesh.uv0.empty() && m.model.mesh.normals.empty() && m.model.mesh.colours.empty());
  EXPECT_EQ(m.model.materials.size(), 1u);
  EXPECT_EQ(m.model.mesh.part_names.size(), 1u);
  EXPECT_EQ(m.model.mesh.triangles[3], (Triangle{2, 1, 3}));
}

TEST(ImportStl, BinaryAsciiAndBinaryThatBeginsWithSolid) {
  expect_tetrahedron(import(binary_stl(kTetrahedron)));
  expect_tetrahedron(import(binary_stl(kTetrahedron, "solid of a misleading exporter")));
  expect_tetrahedron(import(bytes_of(ascii_stl())));
  expect_tetrahedron(import(bytes_of(ascii_stl("\r\n"))));
  expect_tetrahedron(import(bytes_of(ascii_stl("\r"))));
}

TEST(ImportStl, WhatHasNoColourIsGreyAndSaysSo) {
  const Model model = import_stl("m.stl", binary_stl(kTetrahedron), {}, {}).model;
  EXPECT_EQ(model.materials.at(0).base_colour, (Vec4f{0.6f, 0.6f, 0.6f, 1}));
  EXPECT_EQ(count_notes(model, "no-colour"), 1);
}

TEST(ImportStl, BytesBehindTheTrianglesAreTold) {
  Bytes bytes = binary_stl(kTetrahedron);
  bytes.push_back(0);
  EXPECT_EQ(count_notes(import(bytes).model, "trailing-bytes"), 0) << "padding";
  bytes.push_back(7);
  const ImportedModel more = import(bytes);
  expect_tetrahedron(more);
  EXPECT_EQ(count_notes(more.model, "trailing-bytes"), 1);
  EXPECT_EQ(count_notes(more.model, "no-colour"), 1);
  bytes = binary_stl(kTetrahedron);
  bytes[80] = 2;  // the count of an exporter that did not know it
  const Model half = import(bytes).model;
  EXPECT_EQ(half.mesh.triangles.size(), 2u);
  EXPECT_EQ(half.notes.at(1).place, "byte 184");
}

TEST(ImportStl, EveryTruncationIsAnError) {
  const Bytes binary = binary_stl(kTetrahedron), ascii = bytes_of(ascii_stl());
  for (const Bytes& whole : {binary, ascii})
    for (std::size_t n = 0; n < whole.size(); ++n) {
      const Bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(n));
      EXPECT_THROW(import(cut), InputError) << n;
    }
}

TEST(ImportStl, FlippedBytesNeverHarm) {
  for (const Bytes& whole : {binary_stl(kTetrahedron), bytes_of(ascii_stl())})
    for (std::size_t i = 0; i < whole.size(); ++i)
      for (int bit : {0, 4, 7}) {
        Bytes bytes = whole;
        bytes[i] = static_cast<std::uint8_t>(bytes[i] ^ 1 << bit);
        try {
          EXPECT_LE(import(bytes).model.mesh.triangles.size(), 4u);
        } catch (const InputError&) {
        }
      }
}

TEST(ImportStl, HostileCountsAreCheckedAgainstTheBytes) {
  Bytes bytes = binary_stl(kTetrahedron);
  const std::uint32_t huge = 0x80000000u;
  std::memcpy(bytes.data() + 80, &huge, 4);
  EXPECT_NE(input_error([&] { import(bytes); }).find("2147483648"), std::string::npos);
  ImportOptions options;
  options.max_triangles = 3;
  EXPECT_THROW(import(binary_stl(kTetrahedron), options), InputError);
}

TEST(ImportStl, NoTrianglesAndNoNumbers) {
  EXPECT_THROW(import(binary_stl({})), InputError);
  EXPECT_THROW(import(bytes_of("solid nothing\nendsolid\n")), InputError);
  const std::string text =
      "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 x 0\nvertex 1 1 "
      "0\nendloop\nendfacet\nendsolid";
  EXPECT_NE(input_error([&] { import(bytes_of(text)); }).find("line 5"), std::string::npos);
  EXPECT_THROW(
      import(bytes_of(
          "solid\nfacet normal 0 0 0\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nendloop\nendfacet\nendsolid")),
      InputError);
}

TEST(ImportStl, NanPositions) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  auto triangles = kTetrahedron;
  triangles[3][1].y = nan;
  const ImportedModel m = import(binary_stl(triangles));
  EXPECT_EQ(m.model.mesh.triangles.size(), 3u);
  EXPECT_EQ(m.model.mesh.positions.size(), 4u);
  EXPECT_EQ(count_notes(m.model, "non-finite-position"), 1);
  for (auto& t : triangles) t[0].x = nan;
  EXPECT_THROW(import(binary_stl(triangles)), InputError);
}

}  // namespace texmesh::import_stl_test
