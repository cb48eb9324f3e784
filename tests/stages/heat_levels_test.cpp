#include "stages/heat_levels.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "stages/ssf_component.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

SurfaceComponent surface_of(const Mesh& m) {
  return largest_surface(condition_mesh(m, true, {}, RunContext{}));
}

/// Vertices pushed along the surface, so that no two triangles are alike.
Mesh uneven_sphere(int levels) {
  Mesh m = testing::even_sphere(levels, 0.06);
  testing::Random random{11};
  const double step = 0.5 / static_cast<double>(1 << levels);
  for (Vec3f& p : m.positions) {
    const Vec3d at = to_double(p), by{random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5};
    const Vec3d along = by - at * (dot(by, at) / dot(at, at));
    p = to_float(at + along * step);
  }
  return m;
}

struct Difference {
  double error = 0;        // relative
  double significant = 0;  // share of responses above a tenth of the rms with the wrong sign
};

/// `vertex`: for every one of the flow's, the one of the truth.
Difference compare(const HeatFlow& flow, const HeatFlow& truth, const std::vector<std::uint32_t>& vertex) {
  double difference = 0, size = 0;
  for (std::size_t v = 0; v < vertex.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double a = flow.response[v][k], b = truth.response[vertex[v]][k];
      difference += (a - b) * (a - b);
      size += b * b;
    }
  const double count = 3 * static_cast<double>(vertex.size()), limit = 0.1 * std::sqrt(size / count);
  Difference out{std::sqrt(difference / size), 0};
  for (std::size_t v = 0; v < vertex.size(); ++v)
    for (int k = 0; k < 3; ++k) {
      const double a = flow.response[v][k], b = truth.response[vertex[v]][k];
      out.significant += ((a < 0) != (b < 0) && std::fabs(b) > limit) / count;
    }
  return out;
}

/// Climbs the pyramid as the stage does and compares every scale with one level in double precision.
void expect_near_the_truth(const Mesh& m) {
  RunContext context;
  context.threads = 2;
  const SsfOptions options;
  const SurfaceComponent c = surface_of(m);
  const SigmaLadder ladder = make_sigma_ladder(options.sigma_max * c.diagonal / c.mean_edge, options);
  const std::span<const double> times(ladder.time.data(), static_cast<std::size_t>(options.scales));
  HeatLevel level = finest_level(c.points, c.corners, 1, options.rate_cap);
  const auto truth = diffuse(level.laplacian, c.points, 0, times, context, HeatPrecision::kDouble);
  const auto single = diffuse(level.laplacian, c.points, 0, times, context);
  std::vector<std::uint32_t> vertex = level.vertex;
  for (std::size_t i = 0; i < times.size(); ++i) {
    const Difference d = compare(single[i], truth[i], vertex);
    EXPECT_LE(d.error, 0.02) << "single precision, S" << i + 1;
    EXPECT_LE(d.significant, 0.001) << "single precision, S" << i + 1;
  }
  // States of the level, from the one that it started from on: the next level takes over one of them.
  std::vector<std::vector<Vec3d>> states{c.points};
  std::vector<double> state_times{0};
  for (std::size_t i = 0; i < times.size(); ++i) {
    if (i > 0 && !carries(level, ladder.sigma[i], options.error_ratio)) {
      HeatLevel coarse = coarsen(level, seed_radius(ladder.sigma[i], options.error_ratio), options.rate_cap);
      std::size_t s = states.size() - 1;
      const double wanted = handover_sigma(ladder.sigma[i]);
      while (s > 0 && state_times[s - 1] > 0 && std::sqrt(2 * state_times[s]) > wanted) --s;
      std::vector<Vec3d> points;
      for (std::size_t v = 0; v < coarse.vertex.size(); ++v) {
        vertex[v] = vertex[coarse.vertex[v]];
        points.push_back(states[s][coarse.vertex[v]]);
      }
      vertex.resize(coarse.vertex.size());
      states = {std::move(points)};
      state_times = {state_times[s]};
      level = std::move(coarse);
    }
    const std::vector<HeatFlow> flow =
        diffuse(level.laplacian, states.back(), state_times.back(), times.subspan(i, 1), context);
    const Difference d = compare(flow[0], truth[i], vertex);
    EXPECT_LE(d.error, 0.1) << "pyramid, S" << i + 1;
    EXPECT_LE(d.significant, 0.006) << "pyramid, S" << i + 1;
    states.push_back(states.back());
    for (std::size_t v = 0; v < vertex.size(); ++v)
      states.back()[v] = states.back()[v] + to_double(flow[0].moved[v]);
    state_times.push_back(times[i]);
  }
  EXPECT_LT(vertex.size(), c.points.size() / 4);
}

TEST(HeatLevels, ThePyramidStaysNearOneLevelInDouble) { expect_near_the_truth(uneven_sphere(6)); }

TEST(HeatLevels, TheSameOnAQuarterOfAMillionVertices) {
  if (!std::getenv("TEXMESH_FULL")) GTEST_SKIP() << "TEXMESH_FULL is not set";
  expect_near_the_truth(uneven_sphere(8));
}

TEST(HeatLevels, CellsShareOutTheWholeSurface) {
  const SurfaceComponent c = surface_of(uneven_sphere(5));
  const HeatLevel fine = finest_level(c.points, c.corners, 1, 10), coarse = coarsen(fine, 4, 10);
  double fine_mass = 0, coarse_mass = 0;
  for (double m : fine.laplacian.mass) fine_mass += m;
  for (double m : coarse.laplacian.mass) coarse_mass += m;
  EXPECT_NEAR(coarse_mass, fine_mass, 1e-9 * fine_mass);
  EXPECT_LT(coarse.points.size(), fine.points.size() / 4);
  EXPECT_GT(coarse.points.size(), fine.points.size() / 80);
  for (std::size_t v = 0; v < coarse.vertex.size(); ++v) {
    if (v > 0) EXPECT_GT(coarse.vertex[v], coarse.vertex[v - 1]);
    EXPECT_EQ(coarse.points[v].x, fine.points[coarse.vertex[v]].x);
    for (std::size_t u = 0; u < v; ++u) EXPECT_GT(length(coarse.points[u] - coarse.points[v]), 1);
  }
  // Heat stays the same in all: w_ij = w_ji.
  const HeatOperator& l = coarse.laplacian;
  for (std::uint32_t i = 0; i < l.vertex_count(); ++i)
    for (std::uint32_t k = l.first[i]; k < l.first[i + 1]; ++k) {
      const std::uint32_t j = l.column[k];
      const auto begin = l.column.begin() + l.first[j], end = l.column.begin() + l.first[j + 1];
      const auto back = std::lower_bound(begin, end, i);
      ASSERT_TRUE(back != end && *back == i);
      const auto at = static_cast<std::size_t>(back - l.column.begin());
      EXPECT_NEAR(l.rate[k] * l.mass[i], l.rate[at] * l.mass[j], 1e-5 * l.rate[k] * l.mass[i]);
    }
  for (std::uint32_t corner : coarse.corners) EXPECT_LT(corner, coarse.points.size());
}

}  // namespace
}  // namespace texmesh
