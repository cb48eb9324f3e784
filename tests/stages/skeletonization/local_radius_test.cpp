#include "stages/skeletonization/curve_skeleton.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "format/base/vec.h"
#include "stages/geometry/triangle_tree.h"
#include "tests/support/meshes.h"

namespace texmesh::local_radius_test {

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

TEST(TriangleTree, DistancesEndAtTheLimit) {
  const TriangleSoup soup = soup_of(testing::bumpy_sphere(10, 14, 0.2f));
  const TriangleTree tree(soup.points, soup.triangles);
  Random random{4};
  for (int q = 0; q < 300; ++q) {
    const Vec3d p{3 * random.uniform() - 1.5, 3 * random.uniform() - 1.5, 3 * random.uniform() - 1.5};
    const TriangleTree::Nearest at = tree.nearest(p);
    Vec3d found;
    for (std::size_t k = 0; k < 3; ++k)
      found = found + soup.points[soup.triangles[at.triangle][k]] * at.weight[k];
    const double square = dot(found - p, found - p);
    std::uint64_t tried = 0;
    const double distance2 = tree.distance2(p, kInfinity, tried);
    EXPECT_NEAR(distance2, square, 1e-12);
    EXPECT_GT(tried, 0u);
    EXPECT_EQ(tree.distance2(p, 1.01 * square, tried), distance2);
    EXPECT_EQ(tree.distance2(p, 0.99 * square, tried), kInfinity);
  }
}

Vec3d any_point(Random& random, double reach) {
  return {reach * (2 * random.uniform() - 1), reach * (2 * random.uniform() - 1),
          reach * (2 * random.uniform() - 1)};
}

std::array<Vec3d, 4> any_corners(Random& random, Vec3d at, double size) {
  std::array<Vec3d, 4> c;
  for (Vec3d& p : c) p = at + any_point(random, size);
  if (dot(cross(c[1] - c[0], c[2] - c[0]), c[3] - c[0]) < 0) std::swap(c[0], c[1]);
  return c;
}

/// The point of a triangle that is deepest in a tetrahedron, by trying many: > 0 when some point is inside.
double deepest(const std::array<Vec3d, 4>& c, const std::array<Vec3d, 3>& t) {
  double best = -kInfinity;
  constexpr int kSteps = 40;
  for (int i = 0; i <= kSteps; ++i)
    for (int j = 0; i + j <= kSteps; ++j) {
      const Vec3d p = (t[0] * i + t[1] * j + t[2] * (kSteps - i - j)) * (1.0 / kSteps);
      double inside = kInfinity;
      for (std::size_t k = 0; k < 4; ++k) {
        const Vec3d a = c[(k + 1) % 4], n = normalized(cross(c[(k + 2) % 4] - a, c[(k + 3) % 4] - a));
        inside = std::min(inside, dot(n, p - a) * (dot(n, c[k] - a) > 0 ? 1 : -1));
      }
      best = std::max(best, inside);
    }
  return best;
}

TEST(Tetrahedron, MeetsWhatHasAPointInIt) {
  Random random{9};
  int met = 0, missed = 0;
  for (int q = 0; q < 1000; ++q) {
    const std::array<Vec3d, 4> corners = any_corners(random, {}, 1);
    const Tetrahedron solid(corners);
    const Vec3d at = any_point(random, 1.2);
    const std::array<Vec3d, 3> triangle{at + any_point(random, 0.5), at + any_point(random, 0.5),
                                        at + any_point(random, 0.5)};
    const double inside = deepest(corners, triangle);
    if (inside > 0) {
      EXPECT_TRUE(solid.meets(triangle));
      ++met;
    } else if (inside < -0.04) {  // between the points that were tried nothing is deeper
      EXPECT_FALSE(solid.meets(triangle));
      ++missed;
    }
    if (inside > 0) {
      Box3d box;
      for (const Vec3d& p : triangle) box.extend(p);
      EXPECT_TRUE(solid.may_meet_box(box));
    }
  }
  EXPECT_GT(met, 30);
  EXPECT_GT(missed, 100);
}

TEST(Tetrahedron, KnowsWhatIsAroundItAndWhatItIsAround) {
  const Tetrahedron unit({Vec3d{0, 0, 0}, Vec3d{1, 0, 0}, Vec3d{0, 1, 0}, Vec3d{0, 0, 1}});
  EXPECT_TRUE(unit.meets({Vec3d{0.1, 0.1, 0.1}, Vec3d{0.2, 0.1, 0.1}, Vec3d{0.1, 0.2, 0.1}}));
  EXPECT_TRUE(unit.meets({Vec3d{-9, -9, 0.1}, Vec3d{9, -9, 0.1}, Vec3d{0, 20, 0.1}}));
  EXPECT_FALSE(unit.meets({Vec3d{-9, -9, 1.1}, Vec3d{9, -9, 1.1}, Vec3d{0, 20, 1.1}}));
  EXPECT_TRUE(unit.may_meet_box(Box3d{{-5, -5, -5}, {5, 5, 5}}));
  EXPECT_FALSE(
      unit.may_meet_box(Box3d{{0.6, 0.6, 0.6}, {1, 1, 1}}));  // inside its box, outside its slanted side
  EXPECT_FALSE(unit.may_meet_box(Box3d{{-1, 0, 0}, {-0.1, 1, 1}}));
}

TEST(TriangleTree, MeetsAgreesWithTryingAll) {
  const TriangleSoup soup = soup_of(testing::bumpy_sphere(10, 14, 0.2f));
  const TriangleTree tree(soup.points, soup.triangles);
  Random random{5};
  int met = 0, missed = 0;
  for (int q = 0; q < 400; ++q) {
    const Tetrahedron solid(any_corners(random, any_point(random, 1.2), 0.3));
    bool any = false;
    for (const Triangle& t : soup.triangles)
      any = any || solid.meets({soup.points[t[0]], soup.points[t[1]], soup.points[t[2]]});
    std::uint64_t tried = 0;
    EXPECT_EQ(tree.meets(solid, tried), any);
    EXPECT_LE(tried, soup.triangles.size());
    ++(any ? met : missed);
  }
  EXPECT_GT(met, 50);
  EXPECT_GT(missed, 50);
}

double exit_of(const TriangleTree& tree, Vec3d from, Vec3d along) {
  TriangleTree::Rays same;
  same.fill(along);
  return tree.exits(from, same)[0];
}

TEST(TriangleTree, RaysOfABundleLeaveWhereEachWouldAlone) {
  const TriangleSoup soup = soup_of(testing::bumpy_sphere(16, 24, 0.2f));
  const TriangleTree tree(soup.points, soup.triangles);
  Random random{9};
  const auto any = [&] {
    return Vec3d{random.uniform() - 0.5, random.uniform() - 0.5, random.uniform() - 0.5};
  };
  for (int q = 0; q < 100; ++q) {
    TriangleTree::Rays rays;
    for (Vec3d& r : rays) r = normalized(any());
    rays[3] = {0, 0, 1}, rays[7] = {-1, 0, 0};
    const Vec3d from = q % 2 ? any() * 3.0 : soup.points[static_cast<std::size_t>(q)];
    const auto found = tree.exits(from, rays);
    for (std::size_t r = 0; r < rays.size(); ++r) EXPECT_EQ(found[r], exit_of(tree, from, rays[r])) << r;
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
    EXPECT_NEAR(exit_of(tree, from, along), expected, 1e-9);
  }
  // From outside looking away, and from outside through: entering does not count, leaving does.
  EXPECT_EQ(exit_of(tree, {5, 0.1, 0.1}, {1, 0, 0}), kInfinity);
  EXPECT_NEAR(exit_of(tree, {5, 0.1, 0.1}, {-1, 0, 0}), 6, 1e-12);
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

}  // namespace texmesh::local_radius_test
