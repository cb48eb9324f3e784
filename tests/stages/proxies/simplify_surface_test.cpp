#include "stages/proxies/simplify_surface.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <limits>
#include <set>

#include "stages/geometry/triangle_tree.h"
#include "tests/stages/proxies/proxy_shapes.h"

namespace texmesh::simplify_surface_test {

using testing::Soup;
using testing::soup_of;

double volume_of(const ProxySurface& s) {
  double sum = 0;
  for (const Triangle& t : s.triangles) {
    const Vec3d a = to_double(s.positions[t[0]]), b = to_double(s.positions[t[1]]);
    sum += dot(a, cross(b, to_double(s.positions[t[2]]))) / 6;
  }
  return sum;
}

/// What ProxySurface promises.
void expect_sound(const ProxySurface& s) {
  ASSERT_EQ(s.group.size(), s.triangles.size());
  std::vector<int> used(s.positions.size(), 0);
  std::set<std::array<float, 3>> places;
  for (const Vec3f p : s.positions) {
    EXPECT_TRUE(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
    EXPECT_TRUE(places.insert({p.x + 0.0f, p.y + 0.0f, p.z + 0.0f}).second);
  }
  for (const Triangle& t : s.triangles) {
    for (const std::uint32_t v : t) {
      ASSERT_LT(v, s.positions.size());
      used[v] = 1;
    }
    const Vec3d a = to_double(s.positions[t[0]]);
    EXPECT_GT(length(cross(to_double(s.positions[t[1]]) - a, to_double(s.positions[t[2]]) - a)), 0);
  }
  EXPECT_EQ(std::count(used.begin(), used.end(), 0), 0);
}

TEST(SimplifySurface, ReachesCountsOfASphereAndStaysNearIt) {
  const auto surfaces = soup_of(testing::sphere(60, 120)).simplified({4000, 1000, 200, 60});
  ASSERT_EQ(surfaces.size(), 4u);
  const std::array<std::uint32_t, 4> counts{4000, 1000, 200, 60};
  for (std::size_t i = 0; i < 4; ++i) {
    expect_sound(surfaces[i]);
    EXPECT_LE(surfaces[i].triangles.size(), counts[i]);
    EXPECT_GE(surfaces[i].triangles.size(), counts[i] - 2);
    // An equilateral triangle of this number with its corners on the sphere is side^2 / 6 inside at its
    // middle. Half as much again is for triangles that are not.
    const double side2 = 4 * 3.14159265 / counts[i] * 4 / std::sqrt(3.0), bound = side2 / 4;
    for (const Vec3f p : surfaces[i].positions) EXPECT_NEAR(length(to_double(p)), 1, bound);
    std::vector<Vec3d> points;
    for (const Vec3f p : surfaces[i].positions) points.push_back(to_double(p));
    const TriangleTree tree(points, surfaces[i].triangles);
    std::uint64_t tried = 0;
    for (const Vec3f p : testing::sphere(12, 24).positions)
      EXPECT_LT(std::sqrt(tree.distance2(to_double(p), 4, tried)), bound);
    EXPECT_NEAR(volume_of(surfaces[i]) / (4.18879), 1, 3 * bound);
  }
}

TEST(SimplifySurface, ALargeCountChangesNothing) {
  const Soup soup = soup_of(testing::cube());
  const ProxySurface s = soup.surface();
  EXPECT_EQ(s.positions.size(), 8u);
  EXPECT_EQ(s.triangles.size(), 12u);
  EXPECT_NEAR(std::fabs(volume_of(s)), 8, 1e-6);
}

TEST(SimplifySurface, AFlatSquareKeepsItsCorners) {
  const auto s = soup_of(testing::sheet(20, 0)).simplified({2}).front();
  expect_sound(s);
  ASSERT_EQ(s.triangles.size(), 2u);
  for (const Vec3f p : s.positions) {  // within the pull towards the middle of an edge, 1e-3 of its length
    EXPECT_NEAR(std::min(std::fabs(p.x), std::fabs(1 - p.x)), 0, 1e-3);
    EXPECT_NEAR(std::min(std::fabs(p.y), std::fabs(1 - p.y)), 0, 1e-3);
    EXPECT_EQ(p.z, 0);
  }
}

TEST(SimplifySurface, TorusKeepsItsHole) {
  const auto s = testing::torus(60, 40).simplified({300}).front();
  expect_sound(s);
  EXPECT_LE(s.triangles.size(), 300u);
  EXPECT_NEAR(std::fabs(volume_of(s)) / (2 * 3.14159265 * 3.14159265 * 0.16), 1, 0.06);
  for (const Vec3f p : s.positions) EXPECT_GT(std::hypot(p.x, p.z), 0.5);
}

TEST(SimplifySurface, LargerComponentsStayAndDustGoes) {
  Mesh dust = testing::sphere(4, 8);
  for (Vec3f& p : dust.positions) p = p * 0.01f;
  const auto s = soup_of(testing::side_by_side({testing::sphere(30, 60), dust, testing::sphere(30, 60)}))
                     .simplified({120})
                     .front();
  expect_sound(s);
  EXPECT_NEAR(std::fabs(volume_of(s)) / (2 * 4.18879), 1, 0.15);
  double least = 1e9;  // the dust lies between the spheres
  for (const Triangle& t : s.triangles) {
    const Vec3d a = to_double(s.positions[t[0]]), b = to_double(s.positions[t[1]]);
    least = std::min(least, length(b - a));
  }
  EXPECT_GT(least, 0.05);
}

TEST(SimplifySurface, GroupsKeepTheirOutline) {
  Soup soup = soup_of(testing::sheet(32, 0));
  for (const Triangle& t : soup.triangles) {
    float x = 0;
    for (const std::uint32_t v : t) x += soup.positions[v].x / 3;
    soup.group.push_back(x < 0.5f ? 7 : 3);
  }
  const auto s = soup.simplified({40}).front();
  expect_sound(s);
  std::array<double, 2> area{};
  for (std::size_t t = 0; t < s.triangles.size(); ++t) {
    ASSERT_TRUE(s.group[t] == 7 || s.group[t] == 3);
    const Vec3d a = to_double(s.positions[s.triangles[t][0]]);
    const Vec3d n =
        cross(to_double(s.positions[s.triangles[t][1]]) - a, to_double(s.positions[s.triangles[t][2]]) - a);
    EXPECT_GT(n.z, 0);
    area[s.group[t] == 7] += n.z / 2;
  }
  EXPECT_NEAR(area[0], 0.5, 1e-3);
  EXPECT_NEAR(area[1], 0.5, 1e-3);
}

TEST(SimplifySurface, FarFromTheOriginItIsTheSameSurface) {
  Soup soup = soup_of(testing::sphere(40, 80));
  for (Vec3f& p : soup.positions) p = p * 4096.0f;  // steps of one unit at 1e7
  for (Vec3f& p : soup.positions) p = {std::round(p.x), std::round(p.y), std::round(p.z)};
  Soup far = soup;
  for (Vec3f& p : far.positions) p = p + Vec3f{10000000, -9000000, 8500000};
  const auto a = soup.simplified({500}).front(), b = far.simplified({500}).front();
  expect_sound(b);
  ASSERT_EQ(a.triangles, b.triangles);
  for (std::size_t i = 0; i < a.positions.size(); ++i)
    EXPECT_LT(
        length(to_double(b.positions[i]) - Vec3d{10000000, -9000000, 8500000} - to_double(a.positions[i])),
        2);
}

TEST(SimplifySurface, TwoRunsAndAnyThreadsGiveTheSameBytes) {
  const Soup soup = soup_of(testing::bumpy_sphere(40, 80));
  RunContext many;
  many.threads = 8;
  const std::vector<std::uint32_t> counts{900, 100};
  EXPECT_EQ(soup.simplified(counts),
            simplify_surface(soup.positions, soup.triangles, soup.group, counts, many));
}

TEST(SimplifySurface, ASnapshotIsTheSameWhateverComesAfter) {
  // The border's weight follows the outermost counts alone.
  const Soup soup = soup_of(testing::bumpy_sphere(40, 80));
  EXPECT_EQ(soup.simplified({900, 400, 100})[2], soup.simplified({900, 100})[1]);
}

TEST(SimplifySurface, HostileSoupsAreReducedNotRefused) {
  testing::Random random{5};
  std::vector<Soup> soups{testing::moebius_strip(60), testing::book(60), testing::book(3000),
                          soup_of(testing::sliver_sheet(24)), soup_of(testing::dust(500, 0.01f))};
  for (int i = 0; i < 6; ++i) soups.push_back(soup_of(testing::random_soup(random, 60, 800, i % 2 ? 5 : 0)));
  Soup repeated = soup_of(testing::sphere(10, 20));
  repeated.triangles.insert(repeated.triangles.end(), repeated.triangles.begin(), repeated.triangles.end());
  soups.push_back(repeated);
  for (const Soup& soup : soups)
    for (const auto& s : soup.simplified({200, 50, 7, 1})) {
      expect_sound(s);
      EXPECT_LE(s.triangles.size(), 200u);
    }
  for (const Soup& soup : soups) EXPECT_LE(soup.simplified({7}).front().triangles.size(), 7u);
}

TEST(SimplifySurface, AFanOfManyTrianglesTakesNoSquareOfTime) {
  Soup fan{{{0, 0, 1}}, {}, {}};
  constexpr std::uint32_t kBlades = 60000;
  for (std::uint32_t i = 0; i < kBlades; ++i) {
    const double a = 6.283185307179586 * i / kBlades;
    fan.positions.push_back(to_float(Vec3d{std::cos(a), std::sin(a), 0}));
    fan.triangles.push_back({0, i + 1, (i + 1) % kBlades + 1});
  }
  const auto s = fan.simplified({64}).front();
  expect_sound(s);
  EXPECT_LE(s.triangles.size(), 64u);
  for (const Vec3f p : s.positions) EXPECT_LT(std::fabs(std::hypot(p.x, p.y) + p.z - 1), 0.05);
}

TEST(SimplifySurface, SmallestAndBrokenInput) {
  const float nan = std::numeric_limits<float>::quiet_NaN();
  Soup one{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}}, {}};
  EXPECT_EQ(one.simplified({1}).front().triangles.size(), 1u);
  EXPECT_EQ(one.simplified({0}).front().triangles.size(), 1u);
  EXPECT_TRUE(one.simplified({}).empty());
  EXPECT_TRUE((Soup{{}, {}, {}}).simplified({5}).front().triangles.empty());
  Soup flat{{{1, 1, 1}, {2, 2, 2}, {3, 3, 3}}, {{0, 1, 2}}, {}};
  EXPECT_TRUE(flat.simplified({5}).front().triangles.empty());
  Soup point{{{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}, {{0, 1, 2}}, {}};
  EXPECT_TRUE(point.simplified({5}).front().positions.empty());
  Soup broken = one;
  broken.positions.push_back({nan, 0, 0});
  broken.triangles.insert(broken.triangles.end(), {{0, 1, 3}, {0, 1, 9}, {0, 0, 1}, {0, 1, 2}, {0, 2, 1}});
  const ProxySurface s = broken.surface();
  EXPECT_EQ(s.triangles, (std::vector<Triangle>{{0, 1, 2}, {0, 2, 1}}));
  Soup huge{{{-3e38f, 0, 0}, {3e38f, 0, 0}, {0, 3e38f, 0}, {0, 0, 1e-38f}}, {{0, 1, 2}, {0, 2, 3}}, {}};
  for (const auto& h : huge.simplified({2, 1})) expect_sound(h);
}

TEST(SimplifySurface, IsCancelled) {
  const std::atomic<bool> stop{true};
  RunContext context;
  context.cancelled = &stop;
  const Soup soup = soup_of(testing::sphere(10, 20));
  const std::vector<std::uint32_t> counts{10};
  EXPECT_THROW(simplify_surface(soup.positions, soup.triangles, soup.group, counts, context), Cancelled);
}

}  // namespace texmesh::simplify_surface_test
