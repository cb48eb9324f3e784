// Other sets of coordinates, odd images and coordinates that are not finite or absent.
#include "stages/fragmentation/fragmentation.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/stages/fragmentation/fragmentation_inputs.h"
#include "tests/stages/geometry/texel_triangles.h"

namespace texmesh::fragmentation_hostile_test {

using namespace testing;  // NOLINT: fixtures

TEST(Fragmentation, SecondTexcoordAndTransform) {
  Mesh mesh = testing::sheet(4, 0);
  mesh.uv1 = mesh.uv0;
  for (Vec2f& uv : mesh.uv1) uv = {uv.x * 0.25f + 0.5f, uv.y * 0.25f + 0.5f};  // texels 32..48 of 64
  Material second = with_base(0), moved = with_base(0);
  second.base_colour_texture.texcoord = 1;
  moved.base_colour_texture.transform = {{0.5f, 0.5f}, {0.25f, 0.25f}, 0};
  const auto a = run_fragmentation(conditioned(mesh), {second}, {image_of(64, 64)}).planes[0];
  const auto b = run_fragmentation(conditioned(mesh), {moved}, {image_of(64, 64)}).planes[0];
  EXPECT_EQ(a.coverage, b.coverage);
  EXPECT_TRUE(is_covered(a.coverage, 64, 31, 40));
  EXPECT_FALSE(is_covered(a.coverage, 64, 30, 40));
  EXPECT_TRUE(is_covered(a.coverage, 64, 48, 40));
  EXPECT_FALSE(is_covered(a.coverage, 64, 49, 40));
  EXPECT_EQ(a.covered_texels[0], 18u * 18u);
}

TEST(Fragmentation, TinyAndOddImages) {
  const ConditionedMesh mesh = conditioned(testing::sheet(4));
  for (const auto& [w, h] : {std::array{1u, 1u}, {32u, 32u}, {678u, 2199u}, {3u, 700u}, {17u, 9u}}) {
    const Fragments out = run_fragmentation(mesh, {with_base(0)}, {image_of(w, h)});
    const TexturePlane& p = out.planes[0];
    EXPECT_EQ(std::accumulate(p.covered_texels.begin(), p.covered_texels.end(), std::uint64_t{0}),
              std::uint64_t{w} * h);
    EXPECT_NEAR(total(p.surface_fraction), 1, 1e-5);
    for (float e : p.eta) EXPECT_TRUE(e >= 0 && e <= 1);
  }
}

TEST(Fragmentation, HostileCoordinatesGiveFiniteTables) {
  const float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
  for (const Wrap wrap : kWraps)
    for (const float v : {nan, inf, -inf, 3e38f, -1e20f, 1e-40f, 1553.0f}) {
      Mesh mesh = testing::sheet(3);
      mesh.uv0[5].x = v;
      mesh.uv0[7].y = -v;
      Material m = with_base(0);
      m.base_colour_texture.wrap_s = m.base_colour_texture.wrap_t = wrap;
      const Fragments out = run_fragmentation(conditioned(mesh), {m}, {image_of(300, 300)});
      const TexturePlane& p = out.planes[0];
      for (float s : p.surface_fraction) EXPECT_TRUE(s >= 0 && s <= 1) << v;
      for (float e : p.eta) EXPECT_TRUE(e >= 0 && e <= 1) << v;
      EXPECT_LE(total(p.surface_fraction), 1.00001);
      EXPECT_EQ(std::isfinite(v), out.notes.empty()) << v;
    }
}

TEST(Fragmentation, MissingCoordinatesAndNoTextures) {
  Mesh mesh = testing::sheet(3);
  mesh.uv0.clear();
  const Fragments out = run_fragmentation(conditioned(mesh), {with_base(0)}, {image_of(300, 300)});
  EXPECT_EQ(*std::max_element(out.planes[0].covered_texels.begin(), out.planes[0].covered_texels.end()), 0u);
  ASSERT_GE(out.notes.size(), 1u);
  EXPECT_EQ(out.notes[0].code, "missing-texture-coordinates");
  EXPECT_EQ(out.notes[0].severity, Severity::kWarning);
  EXPECT_TRUE(run_fragmentation(conditioned(mesh), {Material{}}, {}).planes.empty());
  mesh.triangle_material[0] = 1;
  EXPECT_THROW(run_fragmentation(conditioned(mesh), {with_base(0)}, {image_of(300, 300)}), StageError);
}

TEST(Fragmentation, SameResultForAnyNumberOfThreads) {
  const ConditionedMesh mesh = conditioned(testing::bumpy_sphere(40, 60));
  Material m = with_base(0);
  m.normal_texture.image = 1;
  m.emissive_texture.image = 2;
  const std::vector<Image> images{image_of(700, 900), image_of(1024, 512), image_of(333, 100)};
  const Fragments a = run_fragmentation(mesh, {m}, images, 1), b = run_fragmentation(mesh, {m}, images, 8);
  ASSERT_EQ(a.planes.size(), 8u);
  for (std::size_t p = 0; p < 8; ++p) {
    EXPECT_EQ(a.planes[p].coverage, b.planes[p].coverage);
    EXPECT_EQ(a.planes[p].features, b.planes[p].features);
    EXPECT_EQ(a.planes[p].surface_fraction, b.planes[p].surface_fraction);
    EXPECT_EQ(a.planes[p].eta, b.planes[p].eta);
  }
}

}  // namespace texmesh::fragmentation_hostile_test
