#include "format/model/tangents.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace texmesh::tangents_test {

constexpr std::uint32_t kColumns = 5, kRows = 3;

/// Wavy, with an atlas that is mirrored about the third column; its first two corners have one place in it.
Mesh mirrored_sheet() {
  Mesh m;
  for (std::uint32_t i = 0; i < kColumns * kRows; ++i) {
    const auto x = static_cast<float>(i % kColumns), y = static_cast<float>(i / kColumns);
    m.positions.push_back(
        {x, y + (i % kColumns % 2 == 1 ? 0.25f : 0.0f), std::fmod(x * x + 3 * y * x + y, 5.0f) * 0.125f});
    m.wedge_position.push_back(i);
    m.normals.push_back(to_float(normalized(Vec3d{(std::fmod(x, 3.0) - 1) * 0.25, (y - 1.0) * 0.25, 1})));
    m.uv0.push_back({std::fabs(x - 2) * 0.25f + y * 0.0625f, 1 - y * 0.375f - (x == 2 ? 0.125f : 0.0f)});
  }
  m.uv0[0] = m.uv0[1];
  for (std::uint32_t a = 0; a + kColumns + 1 < kColumns * kRows; ++a) {
    if (a % kColumns + 1 == kColumns) continue;
    m.triangles.push_back({a, a + 1, a + kColumns + 1});
    m.triangles.push_back({a, a + kColumns + 1, a + kColumns});
  }
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"sheet"};
  return m;
}

void expect_tangent(const Mesh& m, std::size_t triangle, std::size_t corner, Vec4f expected) {
  const Vec4f t = m.tangents[m.triangles[triangle][corner]];
  EXPECT_NEAR(t.x, expected.x, 2e-5) << triangle << ' ' << corner;
  EXPECT_NEAR(t.y, expected.y, 2e-5) << triangle << ' ' << corner;
  EXPECT_NEAR(t.z, expected.z, 2e-5) << triangle << ' ' << corner;
  EXPECT_EQ(t.w, expected.w) << triangle << ' ' << corner;
}

// What mikktspace.c gives (npm package mikktspace 1.1.1), w turned round as for glTF.
TEST(Tangents, AreThoseOfMikkTSpace) {
  const std::vector<std::array<Vec4f, 3>> expected{
      {{{-0.94742, -0.16033, -0.27694, -1}, {-0.89861, 0.42564, 0.10641, -1}, {-0.98191, 0.18932, 0, -1}}},
      {{{-0.94742, -0.16033, -0.27694, -1}, {-0.98191, 0.18932, 0, -1}, {-0.93871, -0.2525, -0.23468, -1}}},
      {{{-0.89861, 0.42564, 0.10641, -1}, {-0.85528, 0.41034, 0.31641, -1}, {-0.81895, 0.5361, 0.20474, -1}}},
      {{{-0.89861, 0.42564, 0.10641, -1}, {-0.81895, 0.5361, 0.20474, -1}, {-0.98191, 0.18932, 0, -1}}},
      {{{0.8304, 0.55283, -0.06939, 1}, {0.96743, 0.03522, 0.25066, 1}, {0.96216, 0.128, 0.24054, 1}}},
      {{{0.8304, 0.55283, -0.06939, 1}, {0.96216, 0.128, 0.24054, 1}, {0.81547, 0.54171, -0.20387, 1}}},
      {{{0.96743, 0.03522, 0.25066, 1}, {0.94864, -0.30691, -0.07673, 1}, {0.97014, -0.24254, 0, 1}}},
      {{{0.96743, 0.03522, 0.25066, 1}, {0.97014, -0.24254, 0, 1}, {0.96216, 0.128, 0.24054, 1}}},
      {{{-0.93871, -0.2525, -0.23468, -1}, {-0.98191, 0.18932, 0, -1}, {-0.99354, 0.11005, -0.02751, -1}}},
      {{{-0.93871, -0.2525, -0.23468, -1},
        {-0.99354, 0.11005, -0.02751, -1},
        {-0.95738, -0.22295, -0.18361, -1}}},
      {{{-0.98191, 0.18932, 0, -1}, {-0.81895, 0.5361, 0.20474, -1}, {-0.86049, 0.5015, 0.08975, -1}}},
      {{{-0.98191, 0.18932, 0, -1}, {-0.86049, 0.5015, 0.08975, -1}, {-0.99354, 0.11005, -0.02751, -1}}},
      {{{0.81547, 0.54171, -0.20387, 1}, {0.96216, 0.128, 0.24054, 1}, {0.96691, 0.15433, 0.20315, 1}}},
      {{{0.81547, 0.54171, -0.20387, 1}, {0.96691, 0.15433, 0.20315, 1}, {0.84119, 0.43634, -0.31938, 1}}},
      {{{0.96216, 0.128, 0.24054, 1}, {0.97014, -0.24254, 0, 1}, {0.97806, -0.20211, 0.05053, 1}}},
      {{{0.96216, 0.128, 0.24054, 1}, {0.97806, -0.20211, 0.05053, 1}, {0.96691, 0.15433, 0.20315, 1}}},
  };
  Mesh m = mirrored_sheet();
  make_tangents(m, std::vector<int>{0});
  ASSERT_EQ(m.triangles.size(), expected.size());
  for (std::size_t t = 0; t < expected.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) expect_tangent(m, t, k, expected[t][k]);
}

TEST(Tangents, MirroredSidesGetWedgesOfTheirOwn) {
  const Mesh before = mirrored_sheet();
  Mesh m = before;
  make_tangents(m, std::vector<int>{0});
  EXPECT_EQ(m.wedge_count(), before.wedge_count() + kRows);
  EXPECT_EQ(m.positions, before.positions);
  EXPECT_EQ(m.tangents.size(), m.wedge_count());
  for (std::size_t t = 0; t < m.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint32_t a = before.triangles[t][k], b = m.triangles[t][k];
      EXPECT_EQ(before.wedge_position[a], m.wedge_position[b]);
      EXPECT_EQ(before.uv0[a], m.uv0[b]);
      EXPECT_EQ(before.normals[a], m.normals[b]);
    }
  for (std::uint32_t w = 0; w < m.wedge_count(); ++w) {
    const Vec4f t = m.tangents[w];
    EXPECT_NEAR(length(Vec3f{t.x, t.y, t.z}), 1, 1e-6);
    EXPECT_NEAR(dot(Vec3f{t.x, t.y, t.z}, m.normals[w]), 0, 1e-6);
  }
}

TEST(Tangents, FollowEqualWedgesAndNotTheirNumbers) {
  Mesh joined = mirrored_sheet(), apart = joined;
  const Mesh whole = joined;
  apart.wedge_position.clear(), apart.normals.clear(), apart.uv0.clear();
  for (Triangle& t : apart.triangles)
    for (std::uint32_t& w : t) {
      apart.wedge_position.push_back(whole.wedge_position[w]);
      apart.normals.push_back(whole.normals[w]);
      apart.uv0.push_back(whole.uv0[w]);
      w = static_cast<std::uint32_t>(apart.wedge_count() - 1);
    }
  make_tangents(joined, std::vector<int>{0});
  make_tangents(apart, std::vector<int>{0});
  for (std::size_t t = 0; t < whole.triangles.size(); ++t)
    for (std::size_t k = 0; k < 3; ++k) expect_tangent(apart, t, k, joined.tangents[joined.triangles[t][k]]);
}

TEST(Tangents, AreForTheMaterialsThatWantThem) {
  Mesh m = mirrored_sheet();
  m.triangle_material.back() = 1;
  m.uv1 = m.uv0;
  for (Vec2f& uv : m.uv1) uv = {uv.y, uv.x};
  Mesh second = m;
  make_tangents(m, std::vector<int>{-1, 0});
  EXPECT_EQ(std::count_if(m.tangents.begin(), m.tangents.end(), [](Vec4f t) { return t.w != 0; }), 3);
  make_tangents(second, std::vector<int>{-1, 1});
  const std::uint32_t corner = second.triangles.back()[0];
  EXPECT_EQ(second.tangents[corner].w, -m.tangents[m.triangles.back()[0]].w);
  EXPECT_LT(std::fabs(second.tangents[corner].x), 0.5f);  // along v of the first set
  make_tangents(m, std::vector<int>{-1, -1});
  EXPECT_TRUE(m.tangents.empty());
  m.normals.clear();
  make_tangents(m, std::vector<int>{0, 0});
  EXPECT_TRUE(m.tangents.empty());
}

TEST(Tangents, WithoutTextureOrAreaTheyPointAnywhere) {
  Mesh flat = mirrored_sheet();
  std::fill(flat.uv0.begin(), flat.uv0.end(), Vec2f{0.5f, 0.5f});
  make_tangents(flat, std::vector<int>{0});
  for (const Vec4f& t : flat.tangents) EXPECT_EQ(t, (Vec4f{1, 0, 0, 1}));
  Mesh needle = mirrored_sheet();
  for (Triangle& t : needle.triangles) t[1] = t[0];
  make_tangents(needle, std::vector<int>{0});
  for (const Triangle& t : needle.triangles)
    for (const std::uint32_t w : t) EXPECT_EQ(needle.tangents[w], (Vec4f{1, 0, 0, 1}));
}

// Pairs of triangles at an edge are found in one pass.
TEST(Tangents, ManyTrianglesAtAnEdgeTakeNoLonger) {
  Mesh fan = mirrored_sheet();
  fan.triangles.assign(200000, fan.triangles[4]);
  fan.triangle_material.assign(fan.triangles.size(), 0);
  make_tangents(fan, std::vector<int>{0});
  EXPECT_EQ(fan.tangents.size(), fan.wedge_count());
}

}  // namespace texmesh::tangents_test
