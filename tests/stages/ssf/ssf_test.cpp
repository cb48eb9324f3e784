#include "stages/ssf/ssf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "stages/ssf/heat_kernel.h"
#include "tests/stages/ssf/ssf_checks.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh::ssf_test {

using namespace testing;  // NOLINT: fixtures

TEST(Ssf, FindsReliefAndLittleOnAPlainSphere) {
  const ScaleMap bumpy = run(even_sphere(5, 0.06)), plain = run(even_sphere(5, 0));
  ASSERT_EQ(conditioned(even_sphere(5, 0)).report.boundary_edges, 0u);
  ASSERT_EQ(plain.persistence.size(), bumpy.persistence.size());
  const std::size_t n = bumpy.persistence.size();
  EXPECT_GT(at_least(bumpy, 8), n / 4);
  EXPECT_GT(bumpy.crossings_at[8], n / 8);
  EXPECT_GT(at_least(bumpy, 12), n / 20);
  for (int i = 4; i <= 20; ++i) EXPECT_LT(at_least(plain, i), n / 100);
  for (int i = 1; i <= 20; ++i) EXPECT_LE(at_least(bumpy, i), at_least(bumpy, i - 1));
  EXPECT_LT(at_least(bumpy, 18), at_least(bumpy, 2) / 2);
}

TEST(Ssf, FeaturesKeepTheirDistanceOnEveryLevel) {
  const Mesh m = even_sphere(6, 0.06);
  // The solver goes to a coarser level at S_13; the relief ends at S_15.
  const SsfOptions options{.error_ratio = 2.5};
  const ScaleMap map = run(m, options);
  // Counts step down without a cliff there.
  for (int i = 2; i <= 15; ++i)
    EXPECT_GT(2.5 * static_cast<double>(at_least(map, i)), static_cast<double>(at_least(map, i - 1))) << i;
  // Beyond the first scales crossings of one scale are no closer than seeds of a level for it would be.
  for (int scale : {10, 14}) {
    const double apart = 0.8 * map.sigma[static_cast<std::size_t>(scale)] / options.error_ratio;
    std::vector<Vec3d> at;
    for (std::size_t p = 0; p < map.crossing.size(); ++p)
      if (map.crossing[p] == scale) at.push_back(to_double(m.positions[p]));
    ASSERT_GT(at.size(), 10u);
    for (std::size_t a = 0; a < at.size(); ++a)
      for (std::size_t b = 0; b < a; ++b) EXPECT_GT(length(at[a] - at[b]), 0.999 * apart);
  }
}

TEST(Ssf, MapsHaveTheShapeThatTheHeaderSays) {
  const Mesh m = testing::bumpy_sphere(20, 30);
  const ScaleMap map = run(m, {.scales = 7});
  EXPECT_EQ(map.scales, 7);
  EXPECT_EQ(map.persistence.size(), m.positions.size());
  EXPECT_EQ(map.crossing.size(), m.positions.size());
  ASSERT_EQ(map.sigma.size(), 8u);
  ASSERT_EQ(map.convergence.size(), 8u);
  ASSERT_EQ(map.crossings_at.size(), 8u);
  EXPECT_EQ(map.sigma[0], 0);
  EXPECT_NEAR(map.sigma[1], surface_of(m).mean_edge, 1e-6);
  EXPECT_NEAR(map.sigma[7], 0.15 * 2 * std::sqrt(3), 0.03);
  for (std::size_t i = 1; i < 8; ++i) {
    EXPECT_GT(map.sigma[i], map.sigma[i - 1]);
    EXPECT_LE(map.convergence[i], map.convergence[i - 1]);
  }
  for (std::size_t p = 0; p < map.crossing.size(); ++p) {
    EXPECT_LE(map.crossing[p], map.persistence[p]);
    EXPECT_LE(map.persistence[p], 7);
  }
}

TEST(Ssf, AFlatSheetHasNoFeaturesInside) {
  const int n = 40;
  const ScaleMap map = run(testing::sheet(n, 0));
  for (std::uint8_t p : map.persistence) EXPECT_EQ(p, 0);
}

TEST(Ssf, SameBytesForAnyThreadCount) {
  // More than one block of rows, and small components beside the large one.
  const Mesh m =
      testing::side_by_side({testing::bumpy_sphere(80, 110), testing::sphere(12, 16), testing::sheet(9)});
  EXPECT_EQ(bytes(run(m, {}, 1)), bytes(run(m, {}, 8)));
}

TEST(Ssf, DoesNotDependOnTheOrderOfTheInput) {
  const Mesh m = testing::bumpy_sphere(40, 60);
  Mesh shuffled = m;
  const std::size_t n = m.positions.size();
  std::vector<std::uint32_t> to(n);
  std::iota(to.begin(), to.end(), 0u);
  Random random{5};
  for (std::size_t i = n; i-- > 1;) std::swap(to[i], to[random.next() % (i + 1)]);
  for (std::size_t p = 0; p < n; ++p) shuffled.positions[to[p]] = m.positions[p];
  for (std::uint32_t& p : shuffled.wedge_position) p = to[p];
  std::reverse(shuffled.triangles.begin(), shuffled.triangles.end());
  const ScaleMap a = run(m), b = run(shuffled);
  std::size_t different = 0;
  for (std::size_t p = 0; p < n; ++p) different += a.persistence[p] != b.persistence[to[p]];
  EXPECT_LE(different, n / 200);
}

TEST(Ssf, ScalesWithTheObject) {
  const Mesh m = testing::bumpy_sphere(40, 60);
  Mesh large = m;
  for (Vec3f& p : large.positions) p = p * 1024.0f;
  const ScaleMap a = run(m), b = run(large);
  EXPECT_EQ(a.persistence, b.persistence);
  EXPECT_FLOAT_EQ(a.sigma[20] * 1024, b.sigma[20]);
}

TEST(Ssf, SmallPartsAreDetailOfTheWhole) {
  Mesh tiny = testing::bumpy_sphere(12, 16, 0.1f);
  for (Vec3f& p : tiny.positions) p = p * 0.05f;
  const Mesh big = testing::bumpy_sphere(40, 60);
  const ScaleMap map = run(testing::side_by_side({big, tiny}));
  std::uint8_t highest = 0;
  for (std::size_t p = big.positions.size(); p < map.persistence.size(); ++p)
    highest = std::max(highest, map.persistence[p]);
  EXPECT_LT(map.sigma[highest], 0.25f * 0.2f);
  EXPECT_GT(at_least(map, 14), 0u);
}

TEST(Ssf, WorkCapSlowsTheFastestRates) {
  const Mesh m = testing::bumpy_sphere(60, 90);
  const ScaleMap free = run(m), capped = run(m, {.max_terms = 100});
  EXPECT_TRUE(free.notes.empty());
  ASSERT_EQ(capped.notes.size(), 1u);
  EXPECT_EQ(capped.notes[0].code, "scale-space-work-cap");
  EXPECT_EQ(capped.sigma, free.sigma);
  EXPECT_NE(capped.persistence, free.persistence);
}

TEST(Ssf, TwinsShareTheirScale) {
  Mesh m = testing::sheet(20, 0.1f);
  const std::size_t n = m.triangles.size();
  for (std::size_t t = 0; t < n; ++t) {
    m.triangles.push_back({m.triangles[t][0], m.triangles[t][2], m.triangles[t][1]});
    m.triangle_material.push_back(0);
    m.triangle_part.push_back(0);
  }
  const ConditionedMesh c = conditioned(m);
  const ScaleMap map = filter_scale_space(c, {}, RunContext{});
  EXPECT_GT(c.mesh.positions.size(), m.positions.size());
  EXPECT_GT(at_least(map, 5), 0u);
  for (std::size_t p = 0; p < c.twin.size(); ++p) EXPECT_EQ(map.persistence[p], map.persistence[c.twin[p]]);
}

TEST(Ssf, DegenerateInputs) {
  Mesh one;
  one.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  one.wedge_position = {0, 1, 2};
  one.uv0 = {{0, 0}, {1, 0}, {0, 1}};
  one.triangles = {{0, 1, 2}};
  one.triangle_material = {0};
  one.triangle_part = {0};
  one.part_names = {"part"};
  EXPECT_EQ(run(one).persistence, (std::vector<std::uint8_t>{0, 0, 0}));
  const ScaleMap several = run(testing::side_by_side({one, one, testing::cube(), one}));
  EXPECT_EQ(at_least(several, 1), 0u);
  // A needle whose cotangents overflow any clamp but ours, with extreme units.
  Mesh needles = testing::sheet(30, 0.05f);
  for (Vec3f& p : needles.positions) p = {p.x * 1e18f, p.y * 1e12f, p.z * 1e12f};
  const ScaleMap map = run(needles);
  for (std::size_t i = 0; i < map.sigma.size(); ++i)
    EXPECT_TRUE(std::isfinite(map.sigma[i]) && std::isfinite(map.convergence[i]));
}

TEST(Ssf, SigmaEndsWhereTheSurfaceHasConverged) {
  const Mesh m = testing::bumpy_sphere(40, 60);
  const ScaleMap whole = run(m, {.sigma_max = 0.5, .convergence = 0}),
                 ended = run(m, {.sigma_max = 0.5, .convergence = 0.6});
  EXPECT_FLOAT_EQ(ended.sigma[1], whole.sigma[1]);
  EXPECT_LT(ended.sigma[20], 0.9f * whole.sigma[20]);
  EXPECT_LT(ended.convergence[20], 0.6f);
  EXPECT_GE(ended.convergence[17], 0.6f);
  EXPECT_LT(whole.convergence[20], 0.5f * ended.convergence[20]);
}

/// R(v) of a body of revolution about the y axis.
Skeleton axis_of(const ConditionedMesh& mesh) {
  Skeleton s;
  for (const Vec3f p : mesh.mesh.positions) s.distance.push_back(std::hypot(p.x, p.z));
  s.radius = s.distance;
  return s;
}

/// r = 1 + a sin 6 alpha: the Laplacian of Gaussian of R is zero where sin 6 alpha is, at k pi / 6.
TEST(SsfOfTheRadius, MarksTheZeroCrossingsOfAKnownRelief) {
  RangeGrid g;
  g.columns = 180;
  g.rows = 30;
  g.alpha_step_rad = static_cast<float>(2 * portable::kPi / g.columns);
  g.y_step = 0.035f;
  for (std::uint32_t i = 0; i < g.columns * g.rows; ++i) {
    const double a = double{g.alpha_step_rad} * (i % g.columns + 0.5);  // no sample on a crossing
    g.radius.push_back(static_cast<float>(1 + 0.05 * portable::sin(6 * a)));
    g.position.push_back(i);
  }
  const ConditionedMesh mesh = conditioned(mesh_of(g));
  SsfOptions options;
  options.scales = 6;
  options.signal = ScaleSignal::kRadius;
  const ScaleMap map = filter_skeleton_distance(mesh, axis_of(mesh), options, RunContext{});
  EXPECT_EQ(map.persistence, map.crossing) << "zero crossings alone";
  std::size_t marked = 0, near = 0;
  for (std::size_t p = 0; p < map.crossing.size(); ++p) {
    const std::uint32_t at = mesh.position_source[p], row = at / g.columns;
    if (map.crossing[p] < 2 || row < 8 || row >= 22) continue;  // open borders bend the response
    ++marked;
    const double steps = 6 * (at % g.columns + 0.5) / g.columns * 2;  // in k pi / 6
    near += std::abs(steps - std::round(steps)) * 15 <= 1;            // within a sample
  }
  EXPECT_GE(marked, 12u * 12);
  EXPECT_GE(near, marked * 95 / 100);
  RunContext eight;
  eight.threads = 8;
  EXPECT_EQ(bytes(filter_skeleton_distance(mesh, axis_of(mesh), options, eight)), bytes(map));
}

TEST(SsfOfTheRadius, RefusesTheSkeletonOfAnotherMesh) {
  const ConditionedMesh mesh = conditioned(testing::sphere(12, 16));
  EXPECT_THROW(filter_skeleton_distance(mesh, {}, {}, RunContext{}), StageError);
}

}  // namespace texmesh::ssf_test
