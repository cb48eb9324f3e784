#include "stages/gltf/draco_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "format/base/errors.h"

namespace texmesh::draco_mesh_test {

constexpr std::uint32_t kSide = 20;  // vertices of a wavy sheet

Vec3f point(std::uint32_t i) {
  const auto x = static_cast<float>(i % kSide), y = static_cast<float>(i / kSide);
  return {x / kSide, y / kSide, 0.1f * std::sin(x) * std::cos(y)};
}

DracoStream sheet(int bits) {
  std::vector<std::uint32_t> indices;
  for (std::uint32_t y = 0; y + 1 < kSide; ++y)
    for (std::uint32_t x = 0; x + 1 < kSide; ++x) {
      const std::uint32_t a = y * kSide + x, b = a + 1, c = a + kSide, d = c + 1;
      indices.insert(indices.end(), {a, b, c, c, b, d});
    }
  DracoMesh mesh(indices, kSide * kSide);
  mesh.add("POSITION", {bits, {0, 0, -1}, 2}, point);
  mesh.add("NORMAL", {8, {}, 1}, [](std::uint32_t) { return Vec3f{0, 0, 1}; });
  mesh.add("TEXCOORD_0", {12, {}, 1}, [](std::uint32_t i) { return Vec2f{point(i).x, point(i).y}; });
  mesh.add("COLOR_0", {}, [](std::uint32_t i) {
    return std::array<std::uint8_t, 4>{static_cast<std::uint8_t>(i % 7), 2, 3, 255};
  });
  mesh.add("_FEATURE_ID_0", {}, [](std::uint32_t i) {
    return std::array<std::uint16_t, 1>{static_cast<std::uint16_t>(i < kSide ? 1 : 300)};
  });
  return mesh.encode(3);
}

TEST(DracoMesh, HasEveryAttributeAndWhatADecoderCounts) {
  const DracoStream stream = sheet(14);
  EXPECT_EQ(stream.vertices, kSide * kSide);
  EXPECT_EQ(stream.triangles, 2 * (kSide - 1) * (kSide - 1));
  EXPECT_EQ(stream.attributes.size(), 5u);
  std::vector<int> ids;
  for (const auto& [name, id] : stream.attributes) ids.push_back(id);
  std::ranges::sort(ids);
  EXPECT_EQ(std::ranges::unique(ids).begin(), ids.end());
  EXPECT_EQ(stream.bytes, sheet(14).bytes);
  EXPECT_LT(sheet(8).bytes.size(), stream.bytes.size());
}

TEST(DracoMesh, IsCodedAnewOnACoarserGridWhereThatIsSmaller) {
  const auto coded = [](const DracoStream& stream, const DracoSteps& steps) {
    return DracoRecoder({stream}, nullptr, "mesh").coded(steps, {}).front();
  };
  const DracoStream fine = sheet(14), coarse = sheet(8);
  const DracoStream coarser = coded(fine, {0.01, 0.01, 6, 6});
  EXPECT_LT(coarser.bytes.size(), fine.bytes.size());
  EXPECT_EQ(coarser.triangles, 2 * (kSide - 1) * (kSide - 1));
  EXPECT_NEAR(coarser.high.x, point(kSide - 1).x, 0.01);
  EXPECT_EQ(coded(coarse, {1e-6, 1e-6, 10, 8}).bytes, coarse.bytes) << "more bytes are not taken";
  DracoStream damaged = fine;
  damaged.bytes.resize(20);
  EXPECT_THROW(coded(damaged, {0.01, 0.01, 6, 6}), FormatError);
}

TEST(DracoMesh, EveryCodingStartsFromTheSameValues) {
  const DracoSteps first{0.1, 0.1, 4, 2}, second{0.01, 0.01, 6, 6};
  DracoRecoder once({sheet(14)}, nullptr, "mesh"), twice({sheet(14)}, nullptr, "mesh");
  once.coded(first, {});
  EXPECT_EQ(once.coded(second, {}).front().bytes, twice.coded(second, {}).front().bytes);
}

}  // namespace texmesh::draco_mesh_test
