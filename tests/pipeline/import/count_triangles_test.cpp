#include "pipeline/import/import.h"

#include <gtest/gtest.h>

#include <string>

#include "format/base/bytes.h"

namespace texmesh::count_triangles_test {

Bytes bytes_of(const std::string& text, std::size_t more = 0) {
  Bytes out(text.begin(), text.end());
  out.resize(out.size() + more);
  return out;
}

Bytes glb(const std::string& json, std::size_t binary_bytes) {
  Bytes out = bytes_of("glTF");
  const auto word = [&](std::size_t value) {
    for (int k = 0; k < 4; ++k) out.push_back(static_cast<std::uint8_t>(value >> (8 * k)));
  };
  word(2);
  word(20 + json.size() + binary_bytes);
  word(json.size());
  word(0x4E4F534A);
  out.insert(out.end(), json.begin(), json.end());
  out.resize(out.size() + binary_bytes);
  return out;
}

TEST(CountTriangles, GlbsSumTheirPrimitives) {
  const std::string json =
      R"({"accessors":[{"count":300},{"count":90},{"count":60}],"meshes":[{"primitives":[{"indices":0},)"
      R"({"indices":9,"mode":4},{"mode":1,"indices":0},{"attributes":{"POSITION":1}}]},)"
      R"({"primitives":[{"indices":2,"mode":4}]}]})";
  EXPECT_EQ(count_triangles("a.bin", glb(json, 400)), 100u + 30 + 20);
}

TEST(CountTriangles, OtherFormatsSayItToo) {
  EXPECT_EQ(count_triangles(
                "a.ply", bytes_of("ply\nformat ascii 1.0\nelement vertex 9\nelement face 12\nend_header\n")),
            12u);
  EXPECT_EQ(count_triangles("a.obj", bytes_of("v 0 0 0\nf 1 2 3\nvn 0 0 1\nf 1 2 3 4\nfoo\n# f 1\nf 3 2 1")),
            3u);
  Bytes stl(84 + 50 * 7);
  stl[80] = 7;
  EXPECT_EQ(count_triangles("a.stl", stl), 7u);
}

TEST(CountTriangles, WhatIsBrokenOrBoastsSaysNothing) {
  for (const char* json :
       {"", "[]", "{", R"({"meshes":3,"accessors":4})", R"({"meshes":[1],"accessors":{}})",
        R"({"meshes":[{"primitives":[7,{"indices":"x"},{"indices":-1}]}],"accessors":[1]})",
        R"({"accessors":[{"count":-300}],"meshes":[{"primitives":[{"indices":0}]}]})",
        R"({"accessors":[{"count":4000000000}],"meshes":[{"primitives":[{"indices":0}]}]})",
        R"({"accessors":[{"count":1e300}],"meshes":[{"primitives":[{"indices":0}]}]})"})
    EXPECT_EQ(count_triangles("a.glb", glb(json, 100)), 0u) << json;
  const std::string triangles = R"("accessors":[{"count":300}],"meshes":[{"primitives":[{"indices":0}]}])";
  EXPECT_EQ(count_triangles("a.glb", glb("{" + triangles + "}", 100)), 100u);
  EXPECT_EQ(
      count_triangles(
          "a.glb", glb("{\"a\":" + std::string(64, '[') + std::string(64, ']') + "," + triangles + "}", 100)),
      0u);
  EXPECT_EQ(count_triangles("a.glb", glb("{\"a\":" + std::string(300'000, '['), 100)), 0u);
  Bytes cut = glb("{}", 0);
  for (std::size_t size = 0; size <= cut.size(); ++size)
    EXPECT_EQ(count_triangles("a.glb", {cut.data(), size}), 0u) << size;
  EXPECT_EQ(count_triangles("a.ply", bytes_of("ply\nelement face 99999999999999999999999\nend_header\n")),
            0u);
  EXPECT_EQ(count_triangles("a.ply", bytes_of("ply\nend_header\nelement face 3\n")), 0u);
  EXPECT_EQ(count_triangles("a.stl", Bytes(84)), 0u);
  EXPECT_EQ(count_triangles("", {}), 0u);
}

}  // namespace texmesh::count_triangles_test
