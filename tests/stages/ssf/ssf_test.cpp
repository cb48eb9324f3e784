#include "stages/ssf/ssf.h"

#include <gtest/gtest.h>

#include <eigen3/Eigen/Dense>

#include <algorithm>
#include <numeric>

#include "format/base/archive.h"
#include "format/base/no_index.h"
#include "format/base/portable_math.h"
#include "stages/condition/condition.h"
#include "stages/ssf/heat_kernel.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

using testing::even_sphere;
using testing::Random;

ConditionedMesh conditioned(const Mesh& m) { return condition_mesh(m, true, {}, RunContext{}); }

ScaleMap run(const Mesh& m, const SsfOptions& options = {}, int threads = 1) {
  RunContext context;
  context.threads = threads;
  return filter_scale_space(conditioned(m), options, context);
}

std::vector<std::uint8_t> bytes(const ScaleMap& map) {
  ArchiveWriter writer;
  writer(map);
  return writer.take();
}

std::size_t at_least(const ScaleMap& map, int scale) {
  return static_cast<std::size_t>(
      std::count_if(map.persistence.begin(), map.persistence.end(), [&](int p) { return p >= scale; }));
}

/// Rows around the y axis with r(alpha, y) = 1 + relief, as a range scanner gives them; open at both ends.
RangeGrid relief_grid(std::uint32_t columns, std::uint32_t rows, double amplitude) {
  RangeGrid g;
  g.columns = columns;
  g.rows = rows;
  g.alpha_step_rad = static_cast<float>(2 * portable::kPi / columns);
  g.y_step = 3.0f / static_cast<float>(rows);
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const double a = 2 * portable::kPi * x / columns, h = 3.0 * y / rows;
      g.radius.push_back(static_cast<float>(1 + amplitude * (portable::sin(6 * a) * portable::sin(4 * h) +
                                                             0.6 * portable::sin(3 * a + 5 * h))));
      g.position.push_back(y * columns + x);
    }
  return g;
}

Mesh mesh_of(const RangeGrid& g) {
  Mesh m;
  for (std::uint32_t y = 0; y < g.rows; ++y)
    for (std::uint32_t x = 0; x < g.columns; ++x) {
      const double r = g.radius[y * g.columns + x], a = double{g.alpha_step_rad} * x;
      m.positions.push_back(
          to_float(Vec3d{r * portable::cos(a), -double{g.y_step} * y, r * portable::sin(a)}));
      m.wedge_position.push_back(y * g.columns + x);
    }
  for (std::uint32_t y = 0; y + 1 < g.rows; ++y)
    for (std::uint32_t x = 0; x < g.columns; ++x) {
      const std::uint32_t a = y * g.columns + x, b = y * g.columns + (x + 1) % g.columns, c = a + g.columns,
                          d = b + g.columns;
      m.triangles.push_back({a, b, d});
      m.triangles.push_back({a, d, c});
    }
  m.triangle_material.assign(m.triangles.size(), 0);
  m.triangle_part.assign(m.triangles.size(), 0);
  m.part_names = {"part"};
  return m;
}

struct Surface {
  std::vector<Vec3d> points;
  std::vector<std::uint32_t> corners;
  double mean_edge = 0;
};

Surface surface_of(const Mesh& m) {
  Surface s;
  for (Vec3f p : m.positions) s.points.push_back(to_double(p));
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
    for (int k = 0; k < 3; ++k) {
      s.corners.push_back(m.position_of(t, k));
      s.mean_edge += length(s.points[m.position_of(t, k)] - s.points[m.position_of(t, (k + 1) % 3)]);
    }
  s.mean_edge /= static_cast<double>(s.corners.size());
  return s;
}

TEST(HeatKernel, MatchesADenseEigenSolveOfTheSameOperator) {
  const Surface s = surface_of(testing::bumpy_sphere(22, 40, 0.08f));
  const HeatOperator l = make_heat_operator({s.points, s.corners, {}}, {}, s.mean_edge, 10);
  const auto n = static_cast<Eigen::Index>(s.points.size());
  // L is similar to a symmetric matrix by the roots of the masses; those follow from w_ij = w_ji row by row.
  Eigen::VectorXd root = Eigen::VectorXd::Zero(n);
  Eigen::MatrixXd symmetric = Eigen::MatrixXd::Zero(n, n);
  std::vector<std::uint32_t> queue{0};
  root[0] = 1;
  for (std::size_t q = 0; q < queue.size(); ++q)
    for (std::uint32_t k = l.first[queue[q]]; k < l.first[queue[q] + 1]; ++k) {
      const std::uint32_t i = queue[q], j = l.column[k];
      double back = 0;
      for (std::uint32_t e = l.first[j]; e < l.first[j + 1]; ++e)
        back = l.column[e] == i ? double{l.rate[e]} : back;
      symmetric(i, j) = -std::sqrt(double{l.rate[k]} * back);
      symmetric(i, i) += double{l.rate[k]};
      if (root[j] == 0) {
        root[j] = root[i] * std::sqrt(double{l.rate[k]} / back);
        queue.push_back(j);
      }
    }
  ASSERT_EQ(queue.size(), s.points.size());
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(symmetric);
  EXPECT_LE(eigen.eigenvalues()[n - 1], l.bound);
  EXPECT_NEAR(eigen.eigenvalues()[0], 0, 1e-9 * l.bound);
  Eigen::MatrixXd x(n, 3);
  for (Eigen::Index i = 0; i < n; ++i)
    for (int k = 0; k < 3; ++k) x(i, k) = s.points[static_cast<std::size_t>(i)][k];

  std::vector<double> times;
  for (double sigma = s.mean_edge; sigma < 1.3; sigma *= 1.4) times.push_back(0.5 * sigma * sigma);
  ASSERT_GT(times.size(), 5u);
  const std::vector<HeatFlow> flows = diffuse(l, s.points, 0, times, RunContext{});
  for (std::size_t t = 0; t < times.size(); ++t) {
    const auto apply = [&](auto&& f) -> Eigen::MatrixXd {
      Eigen::VectorXd d(n);
      for (Eigen::Index i = 0; i < n; ++i) d[i] = f(times[t] * std::max(0.0, eigen.eigenvalues()[i]));
      const Eigen::MatrixXd y = eigen.eigenvectors().transpose() * (root.asDiagonal() * x);
      return root.cwiseInverse().asDiagonal() * (eigen.eigenvectors() * (d.asDiagonal() * y));
    };
    const Eigen::MatrixXd smooth = apply([](double v) { return std::exp(-v); }),
                          response = apply([](double v) { return v * std::exp(-v); });
    double error = 0, size = 0, smooth_error = 0;
    int flips = 0;
    for (Eigen::Index i = 0; i < n; ++i)
      for (int k = 0; k < 3; ++k) {
        const double at = flows[t].response[static_cast<std::size_t>(i)][k],
                     moved = flows[t].moved[static_cast<std::size_t>(i)][k];
        error += std::pow(at - response(i, k), 2);
        size += std::pow(response(i, k), 2);
        smooth_error = std::max(smooth_error, std::fabs(x(i, k) + moved - smooth(i, k)));
        flips += (at < 0) != (response(i, k) < 0);
      }
    EXPECT_LE(std::sqrt(error / size), 0.002) << "time " << t;
    EXPECT_LE(flips, std::max(1.0, 0.001 * 3 * static_cast<double>(n))) << "time " << t;
    EXPECT_LE(smooth_error, 2e-5) << "time " << t;
  }
}

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

TEST(RangeScan, AGridFollowsItsPositionsIntoTheConditionedMesh) {
  RangeGrid grid;
  grid.columns = 5;
  grid.rows = 1;
  grid.position = {0, 1, kNoIndex, 2, 3};
  ConditionedMesh mesh;  // position 1 is gone, 3 has a copy that a split added
  mesh.position_source = {0, 2, 3, 3};
  const RangeGrid moved = grid_on_conditioned(grid, 4, mesh);
  EXPECT_EQ(moved.position, (std::vector<std::uint32_t>{0, kNoIndex, kNoIndex, 1, 2}));
  EXPECT_EQ(moved.columns, 5u);
  grid.position[0] = 4;
  EXPECT_THROW(grid_on_conditioned(grid, 4, mesh), StageError);
  grid.position[0] = 0;
  mesh.position_source[0] = 9;
  EXPECT_THROW(grid_on_conditioned(grid, 4, mesh), StageError);
}

TEST(RangeScan, CrossingsFallWithTheScale) {
  // One row of 360 samples, as Fig. 2.2: fine, middle and coarse structure.
  RangeGrid g;
  g.columns = 360;
  g.rows = 1;
  g.alpha_step_rad = static_cast<float>(2 * portable::kPi / 360);
  g.y_step = 1;
  for (std::uint32_t x = 0; x < 360; ++x) {
    const double a = 2 * portable::kPi * x / 360;
    g.radius.push_back(static_cast<float>(1 + 0.25 * portable::sin(a) + 0.05 * portable::sin(4 * a + 1) +
                                          0.02 * portable::sin(11 * a) + 0.012 * portable::sin(23 * a + 2)));
    g.position.push_back(x);
  }
  const ScaleMap map = filter_range_scan(g, 360, {}, RunContext{});
  EXPECT_GT(map.crossings_at[0], 40u);
  for (std::size_t i = 2; i <= 20; ++i) EXPECT_LE(map.crossings_at[i], map.crossings_at[i - 1] + 2) << i;
  EXPECT_LT(map.crossings_at[14], map.crossings_at[0] / 2);
  EXPECT_LE(map.crossings_at[20], 8u);
  EXPECT_GE(map.crossings_at[20], 2u);
  for (std::size_t i = 1; i <= 20; ++i) EXPECT_LE(map.convergence[i], map.convergence[i - 1] + 1e-6f);
  EXPECT_EQ(map.persistence, map.crossing);
}

TEST(RangeScan, PlainCylinderHasNone) {
  RangeGrid g = relief_grid(64, 40, 0);
  const ScaleMap map = filter_range_scan(g, 64 * 40, {}, RunContext{});
  for (std::uint8_t p : map.persistence) EXPECT_EQ(p, 0);
  for (std::uint32_t n : map.crossings_at) EXPECT_EQ(n, 0u);
}

TEST(RangeScan, UnequalSpacingSeesTheSameShape) {
  const ScaleMap even = filter_range_scan(relief_grid(120, 60, 0.05), 120 * 60, {.scales = 8}, RunContext{});
  const ScaleMap dense =
      filter_range_scan(relief_grid(120, 240, 0.05), 120 * 240, {.scales = 8}, RunContext{});
  // Crossings are curves: four times the rows give more samples on them, but not sixteen times.
  EXPECT_NEAR(even.convergence[8], dense.convergence[8], 0.1);
  EXPECT_GT(dense.crossings_at[4], even.crossings_at[4]);
  EXPECT_LT(dense.crossings_at[4], even.crossings_at[4] * 5);
}

TEST(RangeScan, SigmaEndsWhereTheSignalHasConverged) {
  // Waves of a tenth of the height: gone long before 0.5 of the diagonal.
  RangeGrid g = relief_grid(120, 90, 0);
  for (std::uint32_t y = 0; y < g.rows; ++y)
    for (std::uint32_t x = 0; x < g.columns; ++x)
      g.radius[y * g.columns + x] += static_cast<float>(0.05 * portable::sin(12 * g.alpha_step_rad * x) *
                                                        portable::sin(2 * portable::kPi * 10 * y / g.rows));
  const SsfOptions far{.sigma_max = 0.5, .convergence = 0}, ends{.sigma_max = 0.5, .convergence = 0.3};
  const ScaleMap whole = filter_range_scan(g, 120 * 90, far, RunContext{}),
                 ended = filter_range_scan(g, 120 * 90, ends, RunContext{});
  EXPECT_LT(ended.sigma[20], 0.5f * whole.sigma[20]);
  EXPECT_FLOAT_EQ(ended.sigma[1], whole.sigma[1]);
  EXPECT_LT(ended.convergence[20], 0.3f);
  EXPECT_GE(ended.convergence[15], 0.3f);
  EXPECT_LT(whole.convergence[20], 0.5f * ended.convergence[20]);
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

TEST(RangeScan, HolesPositionsAndThreads) {
  RangeGrid g = relief_grid(90, 50, 0.05);
  for (std::size_t i = 0; i < g.radius.size(); i += 7) g.radius[i] = 0;
  for (std::size_t i = 0; i < g.radius.size(); i += 7) g.position[i] = 0xffffffffu;
  RunContext many;
  many.threads = 8;
  const ScaleMap a = filter_range_scan(g, 90 * 50, {}, RunContext{}),
                 b = filter_range_scan(g, 90 * 50, {}, many);
  EXPECT_EQ(bytes(a), bytes(b));
  for (std::size_t i = 0; i < g.radius.size(); i += 7) EXPECT_EQ(a.persistence[i], 0);
  EXPECT_GT(a.crossings_at[5], 0u);
  g.position[1] = 90 * 50;
  EXPECT_THROW(filter_range_scan(g, 90 * 50, {}, RunContext{}), StageError);
  g.radius.pop_back();
  EXPECT_THROW(filter_range_scan(g, 90 * 50, {}, RunContext{}), StageError);
  EXPECT_THROW(filter_range_scan(RangeGrid{}, 0, {}, RunContext{}), StageError);
}

TEST(RangeScan, AgreesWithTheMeshOnACylinderLikeObject) {
  const RangeGrid g = relief_grid(120, 60, 0.03);
  const SsfOptions options{.scales = 10, .convergence = 0};
  const ScaleMap range = filter_range_scan(g, 120 * 60, options, RunContext{});
  const ScaleMap mesh = run(mesh_of(g), options);
  // Zero crossings of both lie on the same curves: most of the mesh's have one of the range scan's within one
  // sample. Rows near the open ends are left out: there the two treat the border differently.
  std::size_t marked = 0, near = 0, background = 0, total = 0;
  for (std::uint32_t y = 12; y < 48; ++y)
    for (std::uint32_t x = 0; x < 120; ++x) {
      bool close = false;
      for (std::uint32_t dy = 0; dy < 3; ++dy)
        for (std::uint32_t dx = 0; dx < 3; ++dx)
          close = close || range.crossing[(y + dy - 1) * 120 + (x + dx + 119) % 120] >= 4;
      const bool at = mesh.crossing[y * 120 + x] >= 4;
      marked += at;
      near += at && close;
      background += close;
      ++total;
    }
  ASSERT_GT(marked, 100u);
  EXPECT_GT(static_cast<double>(near) / static_cast<double>(marked), 0.98);
  EXPECT_LT(static_cast<double>(background) / static_cast<double>(total), 0.75);
}

/// Ranks from 0, equal values sharing the mean of theirs.
std::vector<double> ranks(const std::vector<double>& value) {
  std::vector<std::size_t> order(value.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return value[a] < value[b]; });
  std::vector<double> rank(value.size());
  for (std::size_t i = 0; i < order.size();) {
    std::size_t end = i;
    while (end < order.size() && value[order[end]] == value[order[i]]) ++end;
    for (std::size_t k = i; k < end; ++k) rank[order[k]] = 0.5 * static_cast<double>(i + end - 1);
    i = end;
  }
  return rank;
}

double spearman(const std::vector<double>& a, const std::vector<double>& b) {
  const std::vector<double> x = ranks(a), y = ranks(b);
  const double mean = 0.5 * static_cast<double>(x.size() - 1);
  double xy = 0, xx = 0, yy = 0;
  for (std::size_t i = 0; i < x.size(); ++i) {
    xy += (x[i] - mean) * (y[i] - mean);
    xx += (x[i] - mean) * (x[i] - mean);
    yy += (y[i] - mean) * (y[i] - mean);
  }
  return xy / std::sqrt(xx * yy);
}

/// A vase with relief of many sizes; sharp detail here, smooth there, so that persistence differs from place
/// to place.
RangeGrid vase(std::uint32_t columns, std::uint32_t rows, double bulge = 0.1) {
  RangeGrid g = relief_grid(columns, rows, 0);
  g.y_step = 3.0f / 80;
  for (std::uint32_t y = 0; y < rows; ++y)
    for (std::uint32_t x = 0; x < columns; ++x) {
      const double a = 2 * portable::kPi * x / columns, h = 3.0 * y / 80;
      const double coarse = 0.04 * portable::sin(2 * a + h) * portable::sin(2.2 * h);
      const double middle = 0.02 * portable::sin(5 * a - 4 * h) * (0.5 + 0.5 * portable::sin(a + 1));
      const double fine =
          0.008 * portable::sin(13 * a) * portable::sin(14 * h) * (0.5 - 0.5 * portable::sin(a + 1));
      g.radius[y * columns + x] = static_cast<float>(1 + bulge * portable::sin(h) + coarse + middle + fine);
    }
  return g;
}

/// Highest crossing within `reach` samples around every sample `margin` rows away from the ends.
std::vector<double> around(const std::vector<std::uint8_t>& crossing, const RangeGrid& g, int reach,
                           int margin) {
  std::vector<double> out;
  const int columns = static_cast<int>(g.columns), rows = static_cast<int>(g.rows);
  for (int y = margin; y < rows - margin; ++y)
    for (int x = 0; x < columns; ++x) {
      int highest = 0;
      for (int dy = -reach; dy <= reach; ++dy)
        for (int dx = -reach; dx <= reach; ++dx)
          highest = std::max(
              highest,
              int{crossing[static_cast<std::size_t>((y + dy) * columns + (x + dx + columns) % columns)]});
      out.push_back(highest);
    }
  return out;
}

/// Spearman of both persistences of a vase 7.5 radii high over the rows that no Gaussian reaches from its
/// ends, for sigmas from a sample to a fifth of the radius.
double agreement(double window, double range_band, double bulge = 0.1) {
  const std::uint32_t columns = 160, rows = 200;
  const RangeGrid g = vase(columns, rows, bulge);
  const double height = 3.0 / 80 * rows, diagonal = std::sqrt(8 * 1.15 * 1.15 + height * height);
  // One level: the coarser ones of the pyramid mark fewer vertices than there are samples on a crossing.
  SsfOptions options{.scales = 10, .sigma_max = 0.2 / diagonal, .convergence = 0, .error_ratio = 1000};
  options.window = window;
  options.range_band = range_band;
  const ScaleMap range = filter_range_scan(g, columns * rows, options, RunContext{});
  const ScaleMap mesh = run(mesh_of(g), options);
  for (std::size_t i = 1; i <= 10; ++i) EXPECT_NEAR(range.sigma[i] / mesh.sigma[i], 1, 0.15);
  return spearman(around(range.crossing, g, 2, 60), around(mesh.crossing, g, 2, 60));
}

TEST(RangeScan, PersistenceRanksAsThatOfTheMesh) {
  // The same Gaussian and the same band: what is left is that a mesh's curvature is taken along its normals.
  EXPECT_GT(agreement(4, SsfOptions{}.band), 0.88);
  // As the thesis has it, a window of 1.4 sigma and the LoG alone: the same on a straight cylinder with
  // relief,
  EXPECT_GT(agreement(SsfOptions{}.window, SsfOptions{}.range_band, 0), 0.88);
  // while on a vase the LoG keeps the base shape's curvature.
  EXPECT_GT(agreement(SsfOptions{}.window, SsfOptions{}.range_band), 0.74);
}

TEST(RangeScan, RanksTellOrderFromDisorder) {
  const RangeGrid g = vase(160, 80);
  const ScaleMap range = filter_range_scan(g, 160 * 80, {.scales = 10}, RunContext{});
  const std::vector<double> self = around(range.crossing, g, 3, 16);
  EXPECT_NEAR(spearman(self, self), 1, 1e-12);
  std::vector<double> reversed = self;
  std::reverse(reversed.begin(), reversed.end());
  EXPECT_LT(spearman(self, reversed), 0.3);
}

}  // namespace
}  // namespace texmesh
