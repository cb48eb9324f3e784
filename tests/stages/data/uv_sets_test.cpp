// Models whose textures use the second set of texture coordinates, or both.
#include "stages/data/conditioned_mesh.h"

#include <gtest/gtest.h>

#include <cmath>

#include "tests/stages/simplification/simplification_checks.h"

namespace texmesh::uv_sets_test {

using namespace testing;  // NOLINT: fixtures and checks

Material material(int base_colour_set, int occlusion_set) {
  Material m;
  if (base_colour_set >= 0)
    m.base_colour_texture.image = 0,
    m.base_colour_texture.texcoord = static_cast<std::uint8_t>(base_colour_set);
  if (occlusion_set >= 0)
    m.occlusion_texture.image = 1, m.occlusion_texture.texcoord = static_cast<std::uint8_t>(occlusion_set);
  return m;
}

TEST(UvSets, TheBaseColourGuides) {
  EXPECT_TRUE(uv_sets_of({}).empty());
  EXPECT_TRUE(uv_sets_of({material(-1, -1), material(0, 0), material(0, -1)}).empty());
  EXPECT_EQ(uv_sets_of({material(0, -1), material(1, -1)}), (std::vector<UvSets>{{0, 0}, {1, 0}}));
  EXPECT_EQ(uv_sets_of({material(1, 0), material(0, 1), material(-1, 1)}),
            (std::vector<UvSets>{{1, 1}, {0, 1}, {1, 0}}));
}

/// A bent sheet whose second set is the first with bends of its own.
Mesh two_sets() {
  Mesh m = sheet(30, 0.1f);
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {
    const double x = static_cast<double>(m.uv0[w].x), y = static_cast<double>(m.uv0[w].y);
    m.uv1.push_back(
        {static_cast<float>(x + 0.04 * std::sin(21 * y)), static_cast<float>(y + 0.04 * std::sin(23 * x))});
  }
  return m;
}

TEST(UvSets, TheSecondSetGuidesAsTheFirstWould) {
  const Mesh first = two_sets();
  Mesh swapped = first;
  std::swap(swapped.uv0, swapped.uv1);
  ConditionedMesh a = condition(first), b = condition(swapped);
  const NestedScales by_first = run(a), by_other = run(b);
  b.uv_sets = {{1, 0}};
  const NestedScales by_second = run(b);
  ASSERT_EQ(by_first.scales.size(), by_second.scales.size());
  for (std::size_t k = 0; k < by_first.scales.size(); ++k)
    EXPECT_EQ(by_first.scales[k].triangles, by_second.scales[k].triangles);
  EXPECT_NE(by_first.scales.back().triangles, by_other.scales.back().triangles)
      << "the sets make no difference";
  // A model that has the second set only.
  Mesh only = swapped;
  only.uv0.clear();
  ConditionedMesh c = condition(only);
  c.uv_sets = {{1, 0}};
  EXPECT_EQ(run(c).scales.back().triangles, by_first.scales.back().triangles);
}

TEST(UvSets, TextureTrianglesOfBothSetsKeepTheirSide) {
  Mesh m = two_sets();
  for (std::size_t w = 0; w < m.wedge_count(); ++w) {  // a set that folds where collapses go far
    const double x = static_cast<double>(m.uv0[w].x), y = static_cast<double>(m.uv0[w].y);
    m.uv1[w] = {static_cast<float>(x + 0.9 / 12 * std::sin(12 * y + 12 * x)), static_cast<float>(y)};
  }
  ConditionedMesh mesh = condition(m);
  const auto turned_over = [&](const NestedScales& scales) {
    Mesh other = scales.mesh;
    other.uv0 = other.uv1;
    std::size_t count = 0;
    for (const NestedScale& s : scales.scales)
      for (std::size_t i = 0; i < s.triangles.size(); ++i)
        count += uv_turn(other, other.triangles[s.triangle_source[i]]) * uv_turn(other, s.triangles[i]) <= 0;
    return count;
  };
  const NestedScales one = run(mesh);
  EXPECT_GT(turned_over(one), 0u) << "nothing to guard against";
  mesh.uv_sets = {{0, 1}};
  const NestedScales both = run(mesh);
  expect_sound(both);
  EXPECT_EQ(turned_over(both), 0u);
  EXPECT_LT(both.scales.back().triangles.size(), both.scales[0].triangles.size() / 8);
}

}  // namespace texmesh::uv_sets_test
