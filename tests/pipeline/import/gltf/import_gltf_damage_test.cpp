// Containers that are cut off, damaged or wrongly put together must end in an InputError.
#include <gtest/gtest.h>

#include <cstring>

#include "tests/pipeline/import/gltf/hostile_gltf.h"

namespace texmesh::import_gltf_damage_test {

using testing::GltfBuilder;
using testing::quad;
using testing::refusal;

TEST(HostileGltf, RefusesWrongContainers) {
  const Bytes good = quad().glb();
  ASSERT_EQ(refusal(good), "");
  const auto with = [&](std::size_t at, std::uint32_t value) {
    Bytes b = good;
    std::memcpy(b.data() + at, &value, 4);
    return refusal(b);
  };
  std::uint32_t json_bytes = 0;
  std::memcpy(&json_bytes, good.data() + 12, 4);
  const std::size_t bin = 20 + json_bytes;
  EXPECT_NE(with(4, 1), "");
  EXPECT_NE(with(4, 3), "");
  EXPECT_NE(with(8, static_cast<std::uint32_t>(good.size()) + 1), "");
  EXPECT_NE(with(8, 0xffffffff), "");
  for (const std::uint32_t n : {0u, 11u, 12u, 19u, 20u, 30u}) EXPECT_NE(with(8, n), "") << n;
  for (const std::uint32_t n :
       {0u, 1u, json_bytes - 4, json_bytes + 4, 0x7fffffffu, 0xfffffff8u, 0xffffffffu}) {
    EXPECT_NE(with(12, n), "") << n;
  }
  EXPECT_NE(with(16, 0x004E4942), "");
  EXPECT_NE(with(16, 0), "");
  for (const std::uint32_t n : {0u, 4u, 0x7fffffffu, 0xfffffff8u, 0xffffffffu})
    EXPECT_NE(with(bin, n), "") << n;
  EXPECT_NE(with(bin + 4, 0x12345678), "");  // then there is no BIN chunk
}

TEST(HostileGltf, RefusesEveryTruncation) {
  const Bytes good = quad().glb();
  for (std::size_t n = 0; n < good.size(); ++n) {
    EXPECT_NE(refusal(Bytes(good.begin(), good.begin() + static_cast<std::ptrdiff_t>(n))), "") << n;
  }
  const Bytes text = quad().gltf("data:;base64,");
  for (std::size_t n = 0; n <= text.size(); ++n) {
    EXPECT_NE(refusal(Bytes(text.begin(), text.begin() + static_cast<std::ptrdiff_t>(n))), "") << n;
  }
}

TEST(HostileGltf, SurvivesEveryFlippedByte) {
  GltfBuilder b = quad();
  b.json["accessors"][0]["sparse"] = {
      {"count", 1},
      {"indices", {{"bufferView", b.view_of<std::uint8_t>({1})}, {"componentType", 5121}}},
      {"values", {{"bufferView", b.view_of<float>({1, 0, 0})}}}};
  b.json["scenes"] = {{{"nodes", {0}}}};
  const Bytes good = b.glb();
  ASSERT_EQ(refusal(good), "");
  std::size_t refused = 0;
  for (std::size_t i = 0; i < good.size(); ++i) {
    for (const int flip : {0x01, 0x10, 0x80, 0xff}) {
      Bytes damaged = good;
      damaged[i] = static_cast<std::uint8_t>(damaged[i] ^ flip);
      refused += !refusal(damaged).empty();
    }
  }
  EXPECT_GT(refused, good.size());  // all of the JSON's brackets, names and numbers
}

}  // namespace texmesh::import_gltf_damage_test
