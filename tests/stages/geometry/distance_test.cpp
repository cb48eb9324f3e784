#include "stages/geometry/distance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "stages/base/run_context.h"
#include "stages/condition/condition.h"
#include "stages/geometry/triangle_tree.h"
#include "stages/simplification/simplification.h"
#include "tests/support/meshes.h"

namespace texmesh::distance_test {

double by_trying_all(const Mesh& mesh, Vec3d p) {
  double best = std::numeric_limits<double>::infinity();
  for (std::uint32_t t = 0; t < mesh.triangles.size(); ++t) {
    std::array<Vec3d, 3> corners;
    for (int k = 0; k < 3; ++k)
      corners[static_cast<std::size_t>(k)] = to_double(mesh.positions[mesh.position_of(t, k)]);
    best = std::min(best, closest_on_triangle(corners, p).distance2);
  }
  return std::sqrt(best);
}

TEST(SurfaceSamples, FewTrianglesHaveFewerPointsAndNoneHaveMoreThanAsked) {
  EXPECT_EQ(enough_samples(0, 4000), 250u);
  EXPECT_EQ(enough_samples(1003, 4000), 250u);
  EXPECT_EQ(enough_samples(1004, 4000), 251u);
  EXPECT_EQ(enough_samples(100000, 4000), 4000u);
  EXPECT_EQ(enough_samples(100000, 100), 100u);
  EXPECT_EQ(enough_samples(12, 100), 100u);
}

void expect_exact(const Mesh& mesh, double size, Vec3d centre) {
  const SurfaceDistance surface(mesh.positions, mesh.wedge_position, mesh.triangles);
  testing::Random random{7};
  SurfaceDistance::Hint last;
  for (int q = 0; q < 300; ++q) {
    const double reach = (q % 3 == 0 ? 100 : 2.4) * size;
    const Vec3d p =
        centre + Vec3d{random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5} * reach;
    const double expected = by_trying_all(mesh, p), near = 1e-9 * reach;
    EXPECT_NEAR(surface(p), expected, near);
    EXPECT_NEAR(surface(p, last), expected, near) << "whatever the hint";
    EXPECT_NEAR(surface(p, last), expected, near) << "the right hint";
    const double bound = surface(p, 0.5 * expected + 0.5 * size);
    EXPECT_GE(bound, expected - near);
    if (expected > 0.5 * expected + 0.5 * size) EXPECT_NEAR(bound, expected, near);
  }
}

TEST(SurfaceDistance, AgreesWithTryingAllTriangles) {
  expect_exact(testing::bumpy_sphere(12, 16, 0.2f), 1, {});
  expect_exact(testing::sheet(9, 0), 1, {});
  expect_exact(testing::cube(), 1, {});
}

TEST(SurfaceDistance, FarFromTheOriginAndInAnyUnitItIsAsExactAsPositionsAre) {
  for (const float size : {1e-12f, 1.0f, 1e25f}) {
    Mesh m = testing::bumpy_sphere(8, 12, 0.2f);
    for (Vec3f& p : m.positions) p = p * size;
    expect_exact(m, static_cast<double>(size), {});
    for (Vec3f& p : m.positions) p = p + Vec3f{size, size, size} * 1e4f;
    expect_exact(m, static_cast<double>(size), to_double(Vec3f{size, size, size} * 1e4f));
  }
}

TEST(SurfaceDistance, ThousandsOfTrianglesInOnePlaceAreSearchedToo) {
  Mesh m = testing::cube();
  const std::vector<Triangle> once = m.triangles;
  for (int i = 0; i < 500; ++i) m.triangles.insert(m.triangles.end(), once.begin(), once.end());
  const SurfaceDistance surface(m.positions, m.wedge_position, m.triangles);
  EXPECT_NEAR(surface({0, 0, 5}), 4, 1e-12);
}

TEST(ScaleWalk, GuessesBoundTheDistanceAndMostAreIt) {
  const ConditionedMesh mesh = condition_mesh(testing::bumpy_sphere(40, 60, 0.1f), true, {}, RunContext{});
  ScaleMap map;
  map.scales = 6;
  for (std::uint32_t p = 0; p < mesh.mesh.positions.size(); ++p)
    map.persistence.push_back(static_cast<std::uint8_t>(p % 7));
  const NestedScales scales = simplify(mesh, map, {.min_triangles = 50}, RunContext{});
  ASSERT_GT(scales.scales.size(), 3u);
  for (std::size_t k = 1; k < scales.scales.size(); ++k) {
    const NestedScale& scale = scales.scales[k];
    const SurfaceDistance surface(scales.mesh.positions, scales.mesh.wedge_position, scale.triangles);
    const auto survivor = survivors(scales.mesh.positions.size(), scales.collapses, scale.collapse_count);
    const ScaleWalk walk(scales.mesh, scale.triangles, survivor, surface);
    std::size_t right = 0, quick_right = 0;
    for (std::uint32_t p = 0; p < scales.mesh.positions.size(); ++p) {
      const Vec3d at = to_double(scales.mesh.positions[p]);
      const double guess = std::sqrt(walk.from(p, at).distance2), distance = surface(at);
      EXPECT_GE(guess, distance - 1e-9);
      right += guess <= distance + 1e-9;
      const double quick = std::sqrt(walk.quick_from(p, at).distance2);
      EXPECT_GE(quick, guess);
      quick_right += quick <= guess + 1e-9;
    }
    EXPECT_GT(static_cast<double>(right), 0.8 * static_cast<double>(scales.mesh.positions.size())) << k;
    EXPECT_GT(static_cast<double>(quick_right), 0.5 * static_cast<double>(scales.mesh.positions.size())) << k;
  }
}

}  // namespace texmesh::distance_test
