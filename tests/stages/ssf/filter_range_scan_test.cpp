#include "stages/ssf/ssf.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "format/base/errors.h"
#include "format/base/vec.h"
#include "stages/data/conditioned_mesh.h"
#include "tests/stages/ssf/ssf_checks.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh::filter_range_scan_test {

using namespace testing;  // NOLINT: fixtures

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

/// r = 1 + a sin 6 alpha over a full turn, in one row.
RangeGrid six_waves(std::uint32_t columns, double amplitude) {
  RangeGrid g;
  g.columns = columns;
  g.rows = 1;
  g.alpha_step_rad = static_cast<float>(2 * portable::kPi / columns);
  g.y_step = 1;
  for (std::uint32_t x = 0; x < columns; ++x) {
    // Every crossing has one nearest sample, a quarter of a step behind it.
    const double a = 2 * portable::kPi * (x + 0.25) / columns;
    g.radius.push_back(static_cast<float>(1 + amplitude * portable::sin(6 * a)));
    g.position.push_back(x);
  }
  return g;
}

TEST(RangeScan, CrossingsOfASineAreWhereTheyMustBe) {
  // Any even filter leaves the sine a sine: its crossings stay at alpha = k pi / 6, at every scale. (Twice as
  // many columns would bring the narrowest filter's response near what rounding makes of radii in floats.)
  constexpr std::uint32_t kColumns = 360, kApart = kColumns / 12;
  for (const double amplitude : {0.02, 0.2}) {
    const ScaleMap map = filter_range_scan(six_waves(kColumns, amplitude), kColumns, {}, RunContext{});
    for (std::uint32_t x = 0; x < kColumns; ++x)
      EXPECT_EQ(map.crossing[x], x % kApart == 0 ? map.scales : 0) << x;
    for (int i = 1; i <= map.scales; ++i) EXPECT_EQ(map.crossings_at[static_cast<std::size_t>(i)], 12u) << i;
  }
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

/// Two turned rings with the same relief by angle, one six times as wide, too far apart to smooth each other.
TEST(RangeScan, SpacingByRowIsThatOfTheRowsRadius) {
  constexpr std::uint32_t kColumns = 240, kRing = 6, kGap = 130, kRows = 2 * kRing + kGap;
  RangeGrid g;
  g.columns = kColumns;
  g.rows = kRows;
  g.full_turn = true;
  g.alpha_step_rad = static_cast<float>(2 * portable::kPi / kColumns);
  g.y_step = 0.05f;
  for (std::uint32_t y = 0; y < kRows; ++y)
    for (std::uint32_t x = 0; x < kColumns; ++x) {
      const double a = 2 * portable::kPi * (x + 0.5) / kColumns, widest = y < kRing ? 1 : 6;
      const double relief = 1 + 0.05 * portable::sin(3 * a) + 0.02 * portable::sin(30 * a);
      g.radius.push_back(y < kRing || y >= kRing + kGap ? static_cast<float>(widest * relief) : 0.0f);
      g.position.push_back(y * kColumns + x);
    }
  SsfOptions options;
  const auto persistence = [](const ScaleMap& map, std::uint32_t row) {
    double sum = 0;
    for (std::size_t x = 0; x < kColumns; ++x) sum += map.persistence[row * kColumns + x];
    return sum;
  };
  const ScaleMap mean = filter_range_scan(g, kColumns * kRows, options, RunContext{});
  EXPECT_NEAR(persistence(mean, 2) / persistence(mean, kRows - 3), 1, 0.05)
      << "by the mean they are the same";
  options.range_spacing = RangeSpacing::kRow;
  const ScaleMap row = filter_range_scan(g, kColumns * kRows, options, RunContext{});
  EXPECT_GT(persistence(row, kRows - 3), 1.3 * persistence(row, 2))
      << "the wide one's relief is six times as long";
}

}  // namespace texmesh::filter_range_scan_test
