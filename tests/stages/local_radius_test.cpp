#include "stages/local_radius.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "format/portable_math.h"
#include "stages/shape_thickness.h"
#include "stages/triangle_tree.h"
#include "tests/support/meshes.h"

namespace texmesh {
namespace {

using testing::Random;
constexpr double kInfinity = std::numeric_limits<double>::infinity();

TriangleSoup soup_of(const Mesh& m, Vec3d stretch = {1, 1, 1}) {
  TriangleSoup soup;
  for (Vec3f p : m.positions) soup.points.push_back({p.x * stretch.x, p.y * stretch.y, p.z * stretch.z});
  for (std::uint32_t t = 0; t < m.triangles.size(); ++t)
    soup.triangles.push_back({m.position_of(t, 0), m.position_of(t, 1), m.position_of(t, 2)});
  return soup;
}

/// A closed box of n x n quads a side: half extents hx, hy, hz.
TriangleSoup box(double hx, double hy, double hz, std::uint32_t n) {
  TriangleSoup soup;
  for (int axis = 0; axis < 3; ++axis)
    for (double sign : {-1.0, 1.0}) {
      const auto first = static_cast<std::uint32_t>(soup.points.size());
      for (std::uint32_t j = 0; j <= n; ++j)
        for (std::uint32_t i = 0; i <= n; ++i) {
          Vec3d p;
          p[axis] = sign;
          p[(axis + 1) % 3] = 2.0 * i / n - 1;
          p[(axis + 2) % 3] = 2.0 * j / n - 1;
          soup.points.push_back({p.x * hx, p.y * hy, p.z * hz});
        }
      for (std::uint32_t j = 0; j < n; ++j)
        for (std::uint32_t i = 0; i < n; ++i) {
          const std::uint32_t a = first + j * (n + 1) + i, b = a + 1, c = a + n + 1, d = c + 1;
          if (sign > 0) {
            soup.triangles.push_back({a, b, d}), soup.triangles.push_back({a, d, c});
          } else {
            soup.triangles.push_back({a, d, b}), soup.triangles.push_back({a, c, d});
          }
        }
    }
  return soup;
}

TEST(TriangleTree, NearestAgreesWithTryingAll) {
  const TriangleSoup soup = soup_of(testing::bumpy_sphere(10, 14, 0.2f));
  const TriangleTree tree(soup.points, soup.triangles);
  Random random{3};
  for (int q = 0; q < 300; ++q) {
    const Vec3d p{3 * random.uniform() - 1.5, 3 * random.uniform() - 1.5, 3 * random.uniform() - 1.5};
    const TriangleTree::Nearest at = tree.nearest(p);
    Vec3d found;
    double sum = 0;
    for (std::size_t k = 0; k < 3; ++k) {
      found = found + soup.points[soup.triangles[at.triangle][k]] * at.weight[k];
      sum += at.weight[k];
      EXPECT_GE(at.weight[k], 0);
    }
    EXPECT_NEAR(sum, 1, 1e-12);
    double best = kInfinity;
    for (const Triangle& t : soup.triangles)
      for (int i = 0; i <= 20; ++i)
        for (int j = 0; i + j <= 20; ++j)
          best = std::min(best, length(soup.points[t[0]] * (i / 20.0) + soup.points[t[1]] * (j / 20.0) +
                                       soup.points[t[2]] * ((20 - i - j) / 20.0) - p));
    EXPECT_LE(length(found - p), best + 1e-12);
    EXPECT_GE(length(found - p), best - 0.02);
  }
}

TEST(TriangleTree, RaysLeaveTheBox) {
  const TriangleSoup soup = box(1, 2, 3, 5);
  const TriangleTree tree(soup.points, soup.triangles);
  Random random{8};
  for (int q = 0; q < 500; ++q) {
    const Vec3d from{1.8 * random.uniform() - 0.9, 3.6 * random.uniform() - 1.8,
                     5.4 * random.uniform() - 2.7};
    const Vec3d along =
        normalized(Vec3d{random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5});
    double expected = kInfinity;
    const double half[3]{1, 2, 3};
    for (int k = 0; k < 3; ++k)
      if (along[k] != 0)
        expected = std::min(expected, ((along[k] > 0 ? half[k] : -half[k]) - from[k]) / along[k]);
    EXPECT_NEAR(tree.exit(from, along), expected, 1e-9);
  }
  // From outside looking away, and from outside through: entering does not count, leaving does.
  EXPECT_EQ(tree.exit({5, 0.1, 0.1}, {1, 0, 0}), kInfinity);
  EXPECT_NEAR(tree.exit({5, 0.1, 0.1}, {-1, 0, 0}), 6, 1e-12);
}

TEST(HalfThickness, OfABallABoxAndAPlate) {
  const RunContext context;
  const auto measure = [&](const TriangleSoup& soup) {
    return half_thickness(soup, TriangleTree(soup.points, soup.triangles), context);
  };
  for (double h : measure(soup_of(testing::sphere(24, 32))))
    EXPECT_NEAR(h, 0.8, 0.06);  // slanting chords: cos^2 of 0.5 rad
  const TriangleSoup plate = box(1, 0.05, 1, 16);
  const std::vector<double> thin = measure(plate);
  for (std::size_t p = 0; p < plate.points.size(); ++p)
    if (std::fabs(plate.points[p].x) < 0.9 && std::fabs(plate.points[p].z) < 0.9)
      EXPECT_NEAR(thin[p], 0.05, 1e-6);
  // Inside out, every ray goes into the void.
  TriangleSoup inverted = plate;
  for (Triangle& t : inverted.triangles) std::swap(t[0], t[1]);
  for (double h : measure(inverted)) EXPECT_EQ(h, kInfinity);
}

TEST(LocalRadius, PlatesHaveHalfTheirThickness) {
  const TriangleSoup plate = box(1, 0.05, 1, 16), ball = soup_of(testing::sphere(24, 32));
  std::vector<Vec3d> points = plate.points;
  std::vector<double> distance;
  for (const Vec3d& p : points) distance.push_back(0.3 + std::fabs(p.x));  // as from a line in its middle
  const LocalRadius local = limit_by_thickness({plate}, points, distance, {.offset = 0.001}, RunContext{});
  EXPECT_EQ(local.plates, 1u);
  for (std::size_t p = 0; p < points.size(); ++p)
    if (std::fabs(points[p].x) < 0.9 && std::fabs(points[p].z) < 0.9)
      EXPECT_NEAR(local.radius[p], 0.049, 1e-6);
  // A ball beside it is none, and keeps its distances.
  TriangleSoup apart = ball;
  for (Vec3d& p : apart.points) p = p + Vec3d{5, 0, 0};
  points.insert(points.end(), apart.points.begin(), apart.points.end());
  distance.resize(points.size(), 1.0);
  const LocalRadius both =
      limit_by_thickness({plate, apart}, points, distance, {.offset = 0.001}, RunContext{});
  EXPECT_EQ(both.plates, 1u);
  EXPECT_EQ(both.parts, 2u);
  for (std::size_t p = plate.points.size(); p < points.size(); ++p) EXPECT_EQ(both.radius[p], 1.0);
}

TEST(LocalRadius, ThinPartsAreBoundedAndSheetsAreNot) {
  const TriangleSoup bar = box(1, 0.1, 0.1, 12);
  // Far from the skeleton of what it belongs to (a body that swallowed it), but the median is not: no plate.
  std::vector<double> distance;
  for (const Vec3d& p : bar.points) distance.push_back(p.x > 0.5 ? 0.9 : 0.1);
  const LocalRadius local = limit_by_thickness({bar}, bar.points, distance, {.offset = 0.002}, RunContext{});
  EXPECT_EQ(local.plates, 0u);
  EXPECT_GT(local.limited, 0u);
  for (std::size_t p = 0; p < bar.points.size(); ++p) {
    if (bar.points[p].x > 0.5 && bar.points[p].x < 0.9) EXPECT_NEAR(local.radius[p], 3 * 0.098, 0.03);
    if (std::fabs(bar.points[p].x) < 0.4) EXPECT_NEAR(local.radius[p], 0.1, 0.02);
  }
  // The same wrap around a sheet: all of its thickness is the wrap's own offset.
  const LocalRadius sheet = limit_by_thickness({bar}, bar.points, distance, {.offset = 0.1}, RunContext{});
  EXPECT_EQ(sheet.limited, 0u);
  EXPECT_EQ(sheet.radius, distance);
}

TEST(LocalRadius, SameBitsForAnyNumberOfThreads) {
  const TriangleSoup soup = soup_of(testing::bumpy_sphere(24, 36, 0.2f), {1, 0.2, 1});
  std::vector<double> distance(soup.points.size(), 0.8);
  RunContext many;
  many.threads = 8;
  EXPECT_EQ(limit_by_thickness({soup}, soup.points, distance, {.offset = 0.001}, RunContext{}).radius,
            limit_by_thickness({soup}, soup.points, distance, {.offset = 0.001}, many).radius);
}

}  // namespace
}  // namespace texmesh
