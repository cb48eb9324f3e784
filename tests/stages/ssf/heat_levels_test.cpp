#include "stages/ssf/heat_kernel.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "stages/condition/condition.h"
#include "stages/ssf/ssf_component.h"
#include "tests/support/even_sphere.h"
#include "tests/support/meshes.h"
#include "tests/support/pyramid_accuracy.h"

namespace texmesh::heat_levels_test {

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

void expect_near_the_truth(const Mesh& m) {
  RunContext context;
  context.threads = 2;
  const SurfaceComponent c = surface_of(m);
  const std::vector<testing::ScaleAccuracy> scales = testing::measure_pyramid(c, {}, context);
  ASSERT_EQ(scales.size(), static_cast<std::size_t>(SsfOptions{}.scales));
  for (std::size_t i = 0; i < scales.size(); ++i) {
    EXPECT_LE(scales[i].single.error, 0.02) << "single precision, S" << i + 1;
    EXPECT_LE(scales[i].single.significant, 0.001) << "single precision, S" << i + 1;
    EXPECT_LE(scales[i].pyramid.error, 0.1) << "pyramid, S" << i + 1;
    EXPECT_LE(scales[i].pyramid.significant, 0.006) << "pyramid, S" << i + 1;
  }
  EXPECT_LT(scales.back().vertices, c.points.size() / 4);
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

}  // namespace texmesh::heat_levels_test
