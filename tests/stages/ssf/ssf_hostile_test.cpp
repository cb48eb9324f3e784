#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/ssf/ssf.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh::ssf_hostile_test {

using testing::even_sphere;

ScaleMap run(const Mesh& m) {
  RunContext context;
  context.threads = 2;
  return filter_scale_space(condition_mesh(m, true, {}, RunContext{}), {}, context);
}

std::size_t at_least(const ScaleMap& map, int scale) {
  return static_cast<std::size_t>(
      std::count_if(map.persistence.begin(), map.persistence.end(), [&](int p) { return p >= scale; }));
}

void expect_sound(const ScaleMap& map) {
  for (std::size_t i = 0; i < map.sigma.size(); ++i) {
    EXPECT_TRUE(std::isfinite(map.sigma[i]));
    EXPECT_TRUE(std::isfinite(map.convergence[i]));
  }
  for (std::size_t p = 0; p < map.persistence.size(); ++p) {
    EXPECT_LE(map.persistence[p], map.scales);
    EXPECT_LE(map.crossing[p], map.persistence[p]);
  }
}

/// Share of the positions whose persistence differs.
double share_different(const ScaleMap& a, const ScaleMap& b) {
  std::size_t different = 0;
  for (std::size_t p = 0; p < a.persistence.size(); ++p) different += a.persistence[p] != b.persistence[p];
  return static_cast<double>(different) / static_cast<double>(a.persistence.size());
}

TEST(SsfHostile, SliversWithoutArea) {
  // The first rows of the sheet are 1e-10 apart: triangles of 1e-12 beside those of 5e-4.
  Mesh m = testing::sheet(30);
  for (Vec3f& p : m.positions)
    if (p.y < 0.17f) p.y *= 3e-9f;
  const ScaleMap map = run(m);
  expect_sound(map);
  EXPECT_GT(at_least(map, 3), 0u);
}

TEST(SsfHostile, ComponentsOfOneTriangle) {
  const std::uint32_t count = std::getenv("TEXMESH_FULL") ? 1'000'000 : 50'000;
  Mesh m;
  for (std::uint32_t t = 0; t < count; ++t) {
    const auto x = static_cast<float>(t % 1000), y = static_cast<float>(t / 1000);
    for (const Vec3f& corner : {Vec3f{x, y, 0}, Vec3f{x + 0.5f, y, 0}, Vec3f{x, y + 0.5f, 0}}) {
      m.wedge_position.push_back(static_cast<std::uint32_t>(m.positions.size()));
      m.positions.push_back(corner);
    }
    m.triangles.push_back({3 * t, 3 * t + 1, 3 * t + 2});
  }
  m.triangle_material.assign(count, 0);
  m.triangle_part.assign(count, 0);
  m.part_names = {"part"};
  const ScaleMap map = run(m);
  EXPECT_EQ(map.persistence.size(), 3u * count);
  EXPECT_EQ(at_least(map, 1), 0u);
  EXPECT_TRUE(map.notes.empty());
}

TEST(SsfHostile, DuplicatedFacesChangeNothing) {
  const Mesh once = even_sphere(4, 0.06);
  Mesh twice = once;
  twice.triangles.insert(twice.triangles.end(), once.triangles.begin(), once.triangles.end());
  twice.triangle_material.assign(twice.triangles.size(), 0);
  twice.triangle_part.assign(twice.triangles.size(), 0);
  const ScaleMap a = run(once), b = run(twice);
  ASSERT_EQ(a.persistence.size(), b.persistence.size());
  EXPECT_GT(at_least(a, 5), 0u);
  EXPECT_EQ(a.persistence, b.persistence);
}

TEST(SsfHostile, InsideOutIsTheSameShape) {
  Mesh out = even_sphere(4, 0.06);
  out.uv0.assign(out.wedge_position.size(), {});
  Mesh in = out;
  for (Triangle& t : in.triangles) std::swap(t[1], t[2]);
  const Mesh both = testing::side_by_side({out, in});
  const ScaleMap alone = run(out), inverted = run(in), map = run(both);
  EXPECT_LT(share_different(alone, inverted), 0.005);
  // Side by side as well: one component is as good as the other.
  std::size_t first = 0, second = 0;
  for (std::size_t p = 0; p < out.positions.size(); ++p) {
    first += map.persistence[p] >= 5;
    second += map.persistence[out.positions.size() + p] >= 5;
  }
  EXPECT_GT(first, 0u);
  EXPECT_NEAR(static_cast<double>(second), static_cast<double>(first), 0.03 * static_cast<double>(first));
}

TEST(SsfHostile, RoundingFarFromTheOriginIsNoRelief) {
  // 1e4 sizes away a coordinate is rounded to 1e-3 of the mean edge's order.
  Mesh plain = even_sphere(5, 0), bumpy = even_sphere(5, 0.06);
  const ScaleMap near = run(bumpy);
  for (Mesh* m : {&plain, &bumpy})
    for (Vec3f& p : m->positions) p = p + Vec3f{2048, 0, 0};
  const ScaleMap far = run(bumpy), none = run(plain);
  EXPECT_LT(at_least(none, 4), none.persistence.size() / 50);
  for (int i : {4, 8, 12})
    EXPECT_NEAR(static_cast<double>(at_least(far, i)), static_cast<double>(at_least(near, i)),
                0.1 * static_cast<double>(at_least(near, i)));
}

}  // namespace texmesh::ssf_hostile_test
